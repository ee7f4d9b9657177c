"""Files of a config: the cell's own, its base, presets, recipes and arms, read as tables without a model."""

from pathlib import Path
from typing import Any

from drivers.errors import ConfigError
from drivers.figures_file import read_toml

_HERE = Path(__file__).parent.parent
SHIPPED = next(place for place in (_HERE / "shipped", _HERE.parent / "config") if (place / "sim.toml").is_file())
"""Folder of the shipped configs: data of the installed package, or the folder `config` of a checkout."""
DEFAULT = SHIPPED / "sim.toml"
"""The simulated cell, the default of every command."""
ERRORS_FILE = "reality.toml"
"""Name of the shipped file with the errors of real cells. It is in the folder of the configs, but is not the file of a cell."""
ARMS = SHIPPED / "arms"
"""Folder of the shipped files of arm figures."""
NOT_INHERITED = (("limits", "force"), ("limits", "low"), ("limits", "high"), ("hole", "centre"), ("rack", "first"))
"""Keys that a cell's file must state even if its base has them: limits, and the places of its parts."""


def layers(path: Path) -> list[tuple[str, dict[str, Any]]]:
    """Return the layers of a cell, each with name and table: the file of its `base` if it names one, beside it or shipped, then its own file."""
    tree = read_toml(path)
    name = tree.pop("base", None)
    if name is None:
        return [(str(path), tree)]
    allowed = sorted(
        {file.name for place in (SHIPPED, path.parent) for file in place.glob("*.toml")} - {path.name, ERRORS_FILE}
    )
    if name not in allowed:
        raise ConfigError(f"{path}: base = {name!r}: no such file; {', '.join(allowed)} allowed")
    base = next(place / name for place in (path.parent, SHIPPED) if (place / name).is_file())
    below = read_toml(base)
    if "base" in below:
        raise ConfigError(f"{path}: base = {name!r}: has a base of its own; a file without one allowed")
    for section, key in NOT_INHERITED:
        table_of(below, section).pop(key, None)
    return [(str(base), below), (str(path), tree)]


def table_of(tree: dict[str, Any], name: str) -> dict[str, Any]:
    """Return a section of a config; an empty table if it is missing, or is no table, which the model then refuses."""
    found = tree.get(name)
    return found if isinstance(found, dict) else {}


def recipe_files(path: Path) -> dict[int, Path]:
    """Return the file of each recipe beside a cell's file, by number.

    Raises:
        ConfigError: The name of a file is not a number that a PLC can request, or two files have the same number.
    """
    files: dict[int, Path] = {}
    for file in sorted((path.parent / "recipes").glob("*.toml")):
        number = int(file.stem) if file.stem.isascii() and file.stem.isdigit() else 0
        if not 1 <= number <= 65535:
            raise ConfigError(f"{file}: recipes are named by their number; 01.toml to 65535.toml allowed")
        if number in files:
            raise ConfigError(f"{file}: recipe {number} is {files[number].name}, too; one file for each number allowed")
        files[number] = file
    return files


def arm_file(model: str) -> Path:
    """Return the path of the file of figures for an `arm.model`; the file may not exist."""
    return Path(model) if model.endswith(".toml") else ARMS / f"{model}.toml"


def has_file(path: Path) -> bool:
    """Return True if a file exists, and False for an invalid name."""
    try:
        return path.is_file()
    except OSError:
        return False


def presets(path: Path | None = None, kind: str = "preset") -> dict[str, Path]:
    """Return the files of presets or worlds available to a cell's file, by name; a file beside it replaces the shipped one."""
    folders = [SHIPPED / f"{kind}s", (path or DEFAULT).parent / f"{kind}s"]
    return {file.stem: file for place in folders for file in sorted(place.glob("*.toml"))}


def find_preset(path: Path, name: Any, kind: str) -> Path:
    """Return the file of a preset or a world by its name.

    Raises:
        ConfigError: The file does not exist.
    """
    known = presets(path, kind)
    if name not in list(known):  # any value of a file, which may not be hashable
        allowed = ", ".join(f'"{k}"' for k in sorted(known)) or "none"
        raise ConfigError(f"{kind} = {name!r}: no such file in {kind}s/; {allowed} allowed")
    return known[name]
