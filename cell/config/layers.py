"""Layers of a config: tables merged key by key, with the origin of each key; pure."""

import re
import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

from drivers.errors import ConfigError
from drivers.part.shapes import follow_shape

Origins = Mapping[tuple[str, ...], str]
"""Origin of each value, a file, `--set` or `parameter`, by the path of its key."""
SET, SIMULATE = "--set", "--simulate"
"""Origins of the single keys and of the simulated devices of a command line."""


def parse_set(text: str) -> tuple[tuple[str, ...], Any]:
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


def nested(values: Iterable[tuple[tuple[str, ...], Any]]) -> dict[str, Any]:
    """Return nested tables that hold each value at its path; of several values at one path, the last one."""
    tables: dict[str, Any] = {}
    for place, value in values:
        for name in reversed(place):
            value = {name: value}
        lay_over(tables, value, "", {})
    return tables


def lay_layer(below: dict[str, Any], above: Mapping[str, Any], name: str, source: dict[tuple[str, ...], str]) -> None:
    """Merge a whole layer into those below; a size kept from below takes the key of the new peg shape."""
    lay_over(below, above, name, source)
    try:
        renamed = follow_shape(below, above)
    except ValueError as error:
        raise ConfigError(f"{name}: {error}") from None
    for section, old, new in renamed:
        source[section, new] = source.pop((section, old), name)


def lay_over(
    below: dict[str, Any],
    above: Mapping[str, Any],
    name: str,
    source: dict[tuple[str, ...], str],
    at: tuple[str, ...] = (),
) -> None:
    """Merge `above` into `below`, tables key by key, other values whole, and store the origin of each key."""
    for key, value in above.items():
        place = (*at, key)
        if isinstance(value, Mapping) and (key not in below or isinstance(below[key], dict)):
            below[key] = dict(below.get(key, {}))
            source.setdefault(place, name)
            lay_over(below[key], value, name, source, place)
        else:
            below[key] = value
            source[place] = name
