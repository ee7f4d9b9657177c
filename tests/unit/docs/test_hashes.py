"""The list of hashes is that of the pinned versions, and names no place to download from."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PIN = re.compile(r"^([A-Za-z0-9._-]+)==([^\s;]+)", re.MULTILINE)
HASHED = (ROOT / "config" / "requirements.txt").read_text(encoding="utf-8")
NOT_FROM_HERE = {"franka-sim", "pylibfranka"}
"""Packages that no install of the development needs: the arm's client and what simulates its controller."""


def pins(text):
    return {re.sub(r"[-_.]+", "-", name).lower(): version for name, version in PIN.findall(text)}


def test_every_pinned_version_has_its_hashes():
    pinned = pins((ROOT / "constraints.txt").read_text(encoding="utf-8"))
    assert pins(HASHED) == {name: version for name, version in pinned.items() if name not in NOT_FROM_HERE}
    lines = [line.strip() for line in HASHED.splitlines() if line.startswith("    ")]
    assert all(re.fullmatch(r"--hash=sha256:[0-9a-f]{64}( \\)?", line) for line in lines)
    assert HASHED.count("\\\n") == len(lines)


def test_every_package_that_is_asked_for_by_name_is_in_it():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = [*project["dependencies"], *project["optional-dependencies"]["dev"]]
    assert {re.split(r"[=<>; ]", name)[0].lower() for name in asked} <= set(pins(HASHED))


def test_it_names_no_address():
    assert not re.search(r"https?:|--index|--find-links| @ ", HASHED)
