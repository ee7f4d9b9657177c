"""The installed version of this program, and versions and licences of its packages, next to the tested versions."""

import platform
import re
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, metadata, requires, version
from textwrap import TextWrapper

from cell.config.files import SHIPPED

PROGRAM = "tactile-insertion-cell"
PINS = SHIPPED / "constraints.txt"
"""File of the repository's pinned versions; the wheel contains it too."""


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


def told() -> str:
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
