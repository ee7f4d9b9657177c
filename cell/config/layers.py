"""Layers of a config: tables merged key by key, with the origin of each key; pure."""

import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from drivers.errors import ConfigError
from drivers.part.shapes import follow_shape

Place = tuple[str, ...]
"""Path of a key: the names of its sections, and its own name."""
Origins = Mapping[Place, str]
"""Origin of each value, a file, `--set` or `parameter`, by the path of its key."""
SET, SIMULATE = "--set", "--simulate"
"""Origins of the values that the options `--set` and `--simulate` state."""


@dataclass(slots=True)
class Layers:
    """A config merged from layers."""

    file: str
    """The cell's file; it counts as the origin of a key that no layer states."""
    tree: dict[str, Any] = field(default_factory=dict)
    """The merged tables."""
    origins: dict[Place, str] = field(default_factory=dict)
    """Origin of each value."""
    order: list[str] = field(default_factory=list)
    """Names of the layers; each layer replaces values of the earlier ones."""

    def lay(self, above: Mapping[str, Any], name: str) -> None:
        """Lay a layer over the earlier ones. If it changes the peg's shape but states no size, rename the earlier size to the new shape's key.

        Raises:
            ConfigError: The new shape cannot have the earlier size.
        """
        self.order.append(name)
        _lay_over(self.tree, above, name, self.origins)
        try:
            renamed = follow_shape(self.tree, above)
        except ValueError as error:
            raise ConfigError(f"{name}: {error}") from None
        for section, old, new in renamed:
            self.origins[section, new] = self.origins.pop((section, old), name)

    def origin(self, place: Place) -> str:
        """Return the origin of a key, else of the innermost of its sections that has an origin, else the cell's file."""
        above = (place[:n] for n in range(len(place), 0, -1))
        return next((self.origins[each] for each in above if each in self.origins), self.file)


def parse_set(text: str) -> tuple[Place, Any]:
    """Return path and value of `KEY.SUBKEY=VALUE`.

    Raises:
        ConfigError: The text does not have this form.
    """
    key, equals, literal = text.partition("=")
    if not equals or not re.fullmatch(r"\w+(\.\w+)*", key.strip()):
        raise ConfigError(f"--set {text}: KEY=VALUE or SECTION.KEY=VALUE allowed, as in peg.diameter=0.008")
    path = tuple(key.strip().split("."))
    try:
        return path, tomllib.loads(f"value = {literal}")["value"]
    except (ValueError, RecursionError):
        return path, literal.strip()


def nested(values: Iterable[tuple[Place, Any]]) -> dict[str, Any]:
    """Return nested tables that hold each value at its path; of several values at one path, the last one."""
    tables: dict[str, Any] = {}
    for place, value in values:
        for name in reversed(place):
            value = {name: value}
        _lay_over(tables, value, "", {})
    return tables


def _lay_over(
    below: dict[str, Any], above: Mapping[str, Any], name: str, origins: dict[Place, str], at: Place = ()
) -> None:
    """Merge `above` into `below`, tables key by key, other values whole, and store the origin of each key."""
    for key, value in above.items():
        place = (*at, key)
        if isinstance(value, Mapping) and (key not in below or isinstance(below[key], dict)):
            below[key] = dict(below.get(key, {}))
            origins.setdefault(place, name)
            _lay_over(below[key], value, name, origins, place)
        else:
            below[key] = value
            origins[place] = name
