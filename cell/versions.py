"""The installed version of this program, and the versions and licences of its packages beside those that it was tested with."""

import platform
import re
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, metadata, requires, version
from pathlib import Path

import config as shipped

PROGRAM = "tactile-insertion-cell"
PINS = Path(shipped.__file__).parent / "constraints.txt"
"""File of the pinned versions of the repository, which the wheel carries as well."""


@dataclass(frozen=True, slots=True)
class PackageLine:
    """One package that the program needs."""

    name: str
    installed: str
    tested: str
    """Version that the test suite runs with."""
    licence: str
    """Licence as the installed package states it."""


def packages() -> list[PackageLine]:
    """Return the packages that the program needs, extras left out, by name."""
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
    """Return the name by which package indexes compare names: PyPA, Names and normalization."""
    return re.sub(r"[-_.]+", "-", name).lower()


def installed(name: str) -> str:
    """Return the version of a package that is installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def licence(name: str) -> str:
    """Return the licence that an installed package states: its expression, its classifier, or the first line of its text."""
    try:
        stated = metadata(name)
    except PackageNotFoundError:
        return "not installed"
    classes = [line.split(" :: ")[-1] for line in stated.get_all("Classifier") or [] if line.startswith("License ::")]
    expressions = stated.get_all("License-Expression") or []
    lines = "\n".join(stated.get_all("License") or []).strip().splitlines()
    return ", ".join(expressions or classes or lines[:1]) or "not stated"


def told() -> str:
    """Return the output of `cell --version`; a package in another version than the tested one is marked."""
    lines = [PackageLine("package", "installed", "tested with", "licence"), *packages()]
    width = max(len(line.name) for line in lines)
    rows = [
        f"{line.name:{width}}  {line.installed:14}  {line.tested:14}"
        + ("  differs  " if line.tested not in (line.installed, "tested with") else "           ")
        + line.licence
        for line in lines
    ]
    return "\n".join([f"cell {installed(PROGRAM)}, Python {platform.python_version()}", *rows])
