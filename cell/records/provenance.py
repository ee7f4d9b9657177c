"""Provenance: versions and licences of packages, and fingerprints of the program's code and of a config."""

import hashlib
import json
import platform
import re
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, metadata, requires, version
from pathlib import Path
from textwrap import TextWrapper
from typing import TYPE_CHECKING

from cell.config.files import ARMS, SHIPPED

if TYPE_CHECKING:
    from cell.config.cell_config import CellConfig

PROGRAM = "tactile-insertion-cell"
PINS = SHIPPED / "constraints.txt"
"""File of the repository's pinned versions; the wheel contains it too."""
PACKAGES = (PROGRAM, "mujoco", "numpy", "numba", "opencv-contrib-python-headless", "pymodbus")
"""Packages whose versions are in each record."""
OWN = ("cell", "drivers", "plc_bridge", "sim", "skills")
"""Packages of this program."""


@lru_cache
def versions() -> dict[str, str]:
    """Return the versions for a record, and a fingerprint of this program's code and arm files."""
    return {**{name: installed(name) for name in PACKAGES}, "code": _code_hash()}


def config_text(config: "CellConfig") -> str:
    """Return a whole config as one line of JSON; equal configs give equal text."""
    return json.dumps(config.model_dump(mode="json"), sort_keys=True)


def digest_of(text: str) -> str:
    """Return a short fingerprint of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def config_hash(config: "CellConfig") -> str:
    """Return a short fingerprint of a whole config."""
    return digest_of(config_text(config))


def _code_hash() -> str:
    root = Path(__file__).parent.parent.parent
    files = [file for package in OWN for file in sorted((root / package).rglob("*.py"))]
    digest = hashlib.sha256()
    for file in (*files, *sorted(ARMS.glob("*.toml"))):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


@dataclass(frozen=True, slots=True)
class PackageLine:
    """One package that the program needs."""

    name: str
    installed: str
    tested: str
    """Version used by the test suite."""
    licence: str
    """Licence stated by the installed package."""


def packages() -> list[PackageLine]:
    """Return the packages that the program needs, without extras, by name."""
    names = sorted(
        re.split(r"[^\w.-]", requirement, maxsplit=1)[0]
        for requirement in requires(PROGRAM) or []
        if "extra ==" not in requirement
    )
    lines = [line.split("==", 1) for line in PINS.read_text(encoding="utf-8").splitlines() if "==" in line]
    pins = {_normalised(name): pinned for name, pinned in lines}
    return [
        PackageLine(name, installed(name), pins.get(_normalised(name), "not pinned"), licence(name)) for name in names
    ]


def _normalised(name: str) -> str:
    """Return the normalized name used by package indexes: PyPA, Names and normalization."""
    return re.sub(r"[-_.]+", "-", name).lower()


def installed(name: str) -> str:
    """Return the installed version of a package."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def licence(name: str) -> str:
    """Return the licence of an installed package: its expression, its classifier, or the first line of its text."""
    try:
        stated = metadata(name)
    except PackageNotFoundError:
        return "not installed"
    classes = [line.split(" :: ")[-1] for line in stated.get_all("Classifier") or [] if line.startswith("License ::")]
    expressions = stated.get_all("License-Expression") or []
    lines = "\n".join(stated.get_all("License") or []).strip().splitlines()
    return ", ".join(expressions or classes or lines[:1]) or "not stated"


def version_text() -> str:
    """Return the output of `cell --version`, at most 80 characters wide; packages in an untested version are marked."""
    lines = packages()
    name, version_ = (max(len(getattr(line, what)) for line in lines) for what in ("name", "installed"))
    fold = TextWrapper(80, subsequent_indent=" " * (name + version_ + 4), replace_whitespace=False).wrap
    rows = [f"cell {installed(PROGRAM)}, Python {platform.python_version()}"]
    for line in lines:
        rows += fold(f"{line.name:{name}}  {line.installed:{version_}}  {line.licence}")
        if line.installed != line.tested:
            rows.append(f"  differs from the tested version {line.tested}")
    return "\n".join(rows)
