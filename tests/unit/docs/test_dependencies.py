"""Packages are pinned with hashes and bounded, and one licence is named everywhere."""

import re
import tomllib

import pytest
from packaging.requirements import Requirement

from tests.pages import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
HASHED = (ROOT / "config" / "requirements.txt").read_text(encoding="utf-8")
NOT_FROM_HERE = {"franka-sim", "pylibfranka"}
"""Packages that no install of the development needs: the arm's client and what simulates its controller."""
SOURCES = [
    path
    for package in ("cell", "config", "drivers", "plc_bridge", "sim", "skills", "tests")
    for path in sorted((ROOT / package).rglob("*"))
    if path.suffix in (".py", ".c", ".h", ".toml", ".go")
]


def pins(text):
    found = re.findall(r"^([A-Za-z0-9._-]+)==([^\s;]+)", text, re.MULTILINE)
    return {re.sub(r"[-_.]+", "-", name).lower(): version for name, version in found}


PINS = pins((ROOT / "constraints.txt").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "requirement", [Requirement(each) for each in PROJECT["dependencies"]], ids=lambda each: each.name
)
def test_every_dependency_has_an_upper_bound_and_its_pin_is_within(requirement):
    assert any(bound.operator in ("<", "==") for bound in requirement.specifier)
    assert requirement.specifier.contains(PINS[requirement.name])


def test_every_pinned_version_has_its_hashes_and_no_address():
    assert pins(HASHED) == {name: version for name, version in PINS.items() if name not in NOT_FROM_HERE}
    lines = [line.strip() for line in HASHED.splitlines() if line.startswith("    ")]
    assert all(re.fullmatch(r"--hash=sha256:[0-9a-f]{64}( \\)?", line) for line in lines)
    assert HASHED.count("\\\n") == len(lines)
    assert not re.search(r"https?:|--index|--find-links| @ ", HASHED)


def test_every_package_that_is_asked_for_by_name_has_hashes():
    asked = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["dev"]]
    assert {re.split(r"[=<>; ]", name)[0].lower() for name in asked} <= set(pins(HASHED))


def test_metadata_and_sources_name_the_licence_of_the_licence_file():
    (file,) = PROJECT["license-files"]
    title, version = (ROOT / file).read_text(encoding="utf-8").split("\n", 3)[1:3]
    assert (title.strip(), version.split(",")[0].strip()) == ("Apache License", "Version 2.0")
    assert PROJECT["license"] == "Apache-2.0"
    line = r"^\W*SPDX-License-Identifier: (.+?)\W*$"
    assert {each for path in SOURCES for each in re.findall(line, path.read_text(encoding="utf-8"), re.M)} == {
        "Apache-2.0"
    }
