"""The installed version of this program, and the versions of its packages that it was tested with."""

import platform
import re
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
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


def packages() -> list[PackageLine]:
    """Return the packages that the program needs, extras left out, by name."""
    names = sorted(
        re.split(r"[^\w.-]", requirement, maxsplit=1)[0]
        for requirement in requires(PROGRAM) or []
        if "extra ==" not in requirement
    )
    lines = [line.split("==", 1) for line in PINS.read_text(encoding="utf-8").splitlines() if "==" in line]
    pins = {_normalised(name): pinned for name, pinned in lines}
    return [PackageLine(name, installed(name), pins.get(_normalised(name), "not pinned")) for name in names]


def _normalised(name: str) -> str:
    """Return the name by which package indexes compare names: PyPA, Names and normalization."""
    return re.sub(r"[-_.]+", "-", name).lower()


def installed(name: str) -> str:
    """Return the version of a package that is installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def told() -> str:
    """Return the output of `cell --version`; a package in another version than the tested one is marked."""
    lines = [PackageLine("package", "installed", "tested with"), *packages()]
    width = max(len(line.name) for line in lines)
    rows = [
        f"{line.name:{width}}  {line.installed:14}  {line.tested}"
        + ("  differs" if line.tested not in (line.installed, "tested with") else "")
        for line in lines
    ]
    return "\n".join([f"cell {installed(PROGRAM)}, Python {platform.python_version()}", *rows])
