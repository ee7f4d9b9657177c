"""Loading of a cell: layers of base, file, world, preset, recipe and single keys, with the origin of each value."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from cell.config.cell_config import RECIPE_SECTIONS, SIMULATED, CellConfig
from cell.config.errors import explain
from cell.config.files import DEFAULT, find_preset, layers, recipe_files, table_of
from cell.config.layers import SET, SIMULATE, Layers, Origins, Place, nested, parse_set
from drivers.errors import ConfigError
from drivers.figures_file import read_toml


@dataclass(frozen=True, slots=True)
class LoadedConfig:
    """A cell and its recipes; each of them is a complete config."""

    recipes: Mapping[int, CellConfig]
    """Complete config of the cell for each recipe, by number; recipe 0 is the part in the cell's file."""
    origins: Mapping[int, Origins] = field(default_factory=dict)
    """Origin of each value that is not a default, by recipe."""

    @property
    def cell(self) -> CellConfig:
        """Config of the cell with its own part."""
        return self.recipes[0]


def load(
    path: Path | None = None, preset: str | None = None, sets: Iterable[str] = (), simulate: Iterable[str] = ()
) -> LoadedConfig:
    """Load a cell from layers; each layer replaces values of the earlier ones.

    The order is: the file's `base`, the file, its world, its preset, the file of each recipe, simulated devices, single keys. The folders
    `worlds/`, `presets/` and `recipes/` are beside the file. If a world or a preset is missing there, the shipped one is
    used.

    Args:
        path: TOML file of the cell; None for the shipped simulated cell.
        preset: Name of a preset that replaces the preset of the file; None to keep that.
        sets: Single keys, `KEY=VALUE`; the value is TOML. A text can be written without quotes.
        simulate: Names of the devices that are simulated, whatever their kind in the file.

    Raises:
        ConfigError: One line with file, key, the value found and the permitted values.
    """
    path = path or DEFAULT
    below = layers(path)
    keys = [parse_set(text) for text in sets]
    if preset is not None:
        keys.append((("preset",), preset))
    files = {0: None, **recipe_files(path)}
    merged = {number: _merged(path, below, file, keys, simulate) for number, file in files.items()}
    recipes = {number: _validated(each, path.parent) for number, each in merged.items()}
    return LoadedConfig(recipes, {number: each.origins for number, each in merged.items()})


def with_parameters(config: CellConfig, parameters: Iterable[tuple[str, Any]]) -> CellConfig:
    """Return a config with values replaced by the parameters of a command: keys of recipes, except `preset`.

    Raises:
        ConfigError: A key is unknown, or a value is not permitted.
    """
    parameters = list(parameters)
    if not parameters:
        return config
    merged = Layers("parameter", config.model_dump())
    for name, _ in parameters:
        if name.split(".")[0] not in RECIPE_SECTIONS - {"preset"}:
            known = ", ".join(sorted(RECIPE_SECTIONS - {"preset"}))
            raise ConfigError(f"parameter {name}: not for a command; keys of {known} allowed")
    merged.lay(nested((tuple(name.split(".")), value) for name, value in parameters), "parameter")
    return _validated(merged)


def _merged(
    path: Path,
    below: list[tuple[str, dict[str, Any]]],
    recipe: Path | None,
    keys: list[tuple[Place, Any]],
    simulate: Iterable[str],
) -> Layers:
    """Return the layers of a cell, or of one of its recipes."""
    merged, part = Layers(str(path)), {} if recipe is None else _read_recipe(recipe)
    for name, tree in below:
        merged.lay(tree, name)
    stated = {**merged.tree, **part, **{keyed[0]: value for keyed, value in keys if len(keyed) == 1}}
    named = {kind: stated.get(kind, "") for kind in ("world", "preset")}
    for kind, name in named.items():
        if name != "":
            file = find_preset(path, name, kind)
            merged.lay(read_toml(file), str(file))
    merged.lay(part, str(recipe))
    merged.tree |= named
    merged.order.append(SIMULATE)
    for name in simulate:
        _simulate(merged.tree, name)
        merged.origins[name, "kind"] = SIMULATE
    merged.lay(nested(keys), SET)
    return merged


def _read_recipe(path: Path) -> dict[str, Any]:
    part = read_toml(path)
    for name in part:
        if name not in RECIPE_SECTIONS:
            raise ConfigError(f"{path}: {name}: not for a recipe; {', '.join(sorted(RECIPE_SECTIONS))} allowed")
    return part


def _simulate(merged: dict[str, Any], name: str) -> None:
    """Make a device simulated: keep the keys that the simulated device also has, and remove the real device's calibration."""
    stated = {key: value for key, value in table_of(merged, name).items() if key in SIMULATED[name].model_fields}
    merged[name] = {**stated, "kind": "sim"}
    table_of(merged, "calibration").pop(name, None)


def _validated(merged: Layers, folder: Path | None = None) -> CellConfig:
    try:
        return CellConfig.model_validate(merged.tree, context={"folder": folder})
    except ValidationError as error:
        raise ConfigError(explain(error, merged)) from None
