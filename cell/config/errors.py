"""Report of a wrong config in one line: file, key, the value found, the permitted values."""

import json
import math
import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from pydantic import ValidationError

from cell.config.cell_config import CellConfig
from cell.config.layers import Layers, Place
from cell.config.nearest import did_you_mean

_KEY = re.compile(r"[a-z_]+(?:\.[a-z_]+)+")


def explain(error: ValidationError, given: Layers) -> str:
    """Return one line about the first fault of a config: file, key, the value found, and the permitted values.

    If two keys conflict, the line names the key from the later layer.
    """
    errors = error.errors(include_url=False)
    # A misspelt key is also reported as missing under its right name.
    first = next((each for each in errors if each["type"] == "extra_forbidden"), errors[0])
    place, schema = schema_at(first["loc"], given.tree)
    key = ".".join(place)
    origin = given.origin(place)
    kind, found = first["type"], first.get("input")
    if kind == "union_tag_not_found":
        return f"{origin}: {key}.kind: missing; {_tags(schema)} needed"
    if kind == "union_tag_invalid":
        return f"{given.origin((*place, 'kind'))}: {key}.kind = {first['ctx']['tag']!r}: {_tags(schema)} allowed"
    if kind == "missing":
        return f"{_beginner(place[:-1], given)}: {key}: missing; {allowed(schema)} needed"
    if kind == "extra_forbidden":
        return f"{origin}: {key}: unknown key; {_known(place, schema)}"
    if kind == "value_error":
        text = first["msg"].removeprefix("Value error, ")
        within = (*place, *text.split(" = ")[0].split("."))
        if not key:
            return f"{_blamed(text, given)}: {text}"
        # The message of a check within a section can name its key.
        return f"{given.origins[within]}: {key}.{text}" if within in given.origins else f"{origin}: {key}: {text}"
    return f"{origin}: {key} = {found!r}: {allowed(schema)} allowed{_hint(place, found, schema)}"


def _tags(schema: Mapping[str, Any]) -> str:
    return ", ".join(f'"{tag}"' for tag in schema["discriminator"]["mapping"])


@lru_cache(maxsize=1)
def _schema() -> Mapping[str, Any]:
    """Return the JSON schema of the whole config, with the definitions that the schema of a key may reference."""
    return CellConfig.model_json_schema()


def _beginner(section: Place, given: Layers) -> str:
    """Return the first layer that states a key of the section if all such layers are above the file, else the file."""
    begun = {name for place, name in given.origins.items() if section and place[: len(section)] == section}
    later = given.order[given.order.index(given.file) + 1 :]
    return min(begun, key=later.index) if begun and begun <= set(later) else given.file


def _blamed(text: str, given: Layers) -> str:
    """Return the latest layer that stated one of the keys in `text`; the cell's file if no layer stated any of them.

    If the key of that layer is not at the start of `text`, add its name.
    """
    named = [place for word in _KEY.findall(text) if (place := tuple(word.split("."))) in given.origins]
    if not named:
        return given.file
    # Of several keys from the latest layer, `max` returns the first one in the text.
    worst = max(named, key=lambda place: given.order.index(given.origins[place]))
    is_first = text.startswith(".".join(worst))
    return given.origins[worst] if is_first else f"{given.origins[worst]}: {'.'.join(worst)}"


def _known(place: Place, schema: Mapping[str, Any]) -> str:
    """Return the keys of a section, and a suggestion, which can be a key of another section."""
    names = sorted(name for variant in _variants(schema) for name in variant.get("properties", {}))
    section = ".".join(place[:-1])
    near = did_you_mean(place[-1], names)
    if near and section:
        near = near.replace("mean ", f"mean {section}.")
    return f"{', '.join(names) or 'none'} allowed{near or _elsewhere(place)}"


def _elsewhere(place: Place) -> str:
    """Return the keys of this name in other sections as a suggestion; empty if there is none."""
    found = [
        f"{section}.{place[-1]}"
        for section, each in _schema()["properties"].items()
        if (section, place[-1]) != place
        if any(place[-1] in variant.get("properties", {}) for variant in _variants(each))
    ]
    return f"; did you mean {' or '.join(found)}?" if found else ""


def _variants(schema: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the schema of each alternative of a key; one schema if it has no alternatives."""
    return [follow(branch) for branch in schema.get("anyOf", schema.get("oneOf", [schema]))]


_BOUNDS = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}
_WORDS = {"number": "a number", "integer": "an integer", "string": "a text", "boolean": "true or false"}
_FORMATS = {"ipv4network": "a network or address", "ipv6network": "a network or address", "path": "a file"}


def allowed(schema: Mapping[str, Any]) -> str:
    """Return the values permitted by the JSON schema of one key, in words; never empty."""
    schema = follow(schema)
    if "const" in schema or "enum" in schema:
        return ", ".join(json.dumps(value) for value in schema.get("enum", [schema.get("const")]))
    either = schema.get("anyOf", schema.get("oneOf", ()))
    branches = [allowed(branch) for branch in either if branch.get("type") != "null"]
    if branches:
        return " or ".join(dict.fromkeys(branches))
    if schema.get("type") == "object":
        return _allowed_table(schema)
    if schema.get("type") == "array":
        return _allowed_list(schema)
    if schema.get("format") in _FORMATS:
        return _FORMATS[schema["format"]]
    return _allowed_number(_WORDS.get(schema.get("type", ""), "another value"), schema)


def _allowed_table(schema: Mapping[str, Any]) -> str:
    if "properties" in schema:
        needed = schema.get("required", ())
        names = [f"{name} (needed)" if name in needed else name for name in schema["properties"]]
        return f"a section with {', '.join(names)}"
    others = schema.get("additionalProperties", {})
    return f"a table, each value {allowed(others if isinstance(others, Mapping) else {})}"


def _allowed_list(schema: Mapping[str, Any]) -> str:
    inner = [allowed(each) for each in schema.get("prefixItems", ())]
    if not inner:
        return f"a list, each {allowed(schema.get('items', {}))}"
    return f"{len(inner)} values, each {inner[0]}" if len(set(inner)) == 1 else f"a list of {', '.join(inner)}"


def _allowed_number(name: str, schema: Mapping[str, Any]) -> str:
    if "minimum" in schema and "maximum" in schema:
        return f"{name} from {schema['minimum']:g} to {schema['maximum']:g}"
    parts = [f"{sign} {schema[bound]:g}" for bound, sign in _BOUNDS.items() if bound in schema]
    return " ".join([name, " and ".join(parts)]).strip()


_SMALLER = {"m": ("mm", 1e-3), "m/s": ("mm/s", 1e-3), "rad": ("degrees", math.pi / 180.0)}
"""Smaller unit often typed by mistake, and its size in the SI unit, by SI unit."""


def _hint(place: Place, found: Any, schema: Mapping[str, Any]) -> str:
    """Return a hint to the probable cause if a number is too large for its unit, but not for a smaller unit."""
    from cell.config.keys import find  # imported late: it imports this module

    unit = next((key.unit for key in find(".".join(step for step in place if not step.isdigit()))), "")
    if unit not in _SMALLER or isinstance(found, bool) or not isinstance(found, int | float):
        return ""
    word, size = _SMALLER[unit]
    for branch in schema.get("anyOf", [schema]):
        high = branch.get("maximum", branch.get("exclusiveMaximum"))
        if branch.get("type") == "number" and high is not None and high < found <= high / size:
            return f"; SI units: {found:g} {word} is {found * size:.4g} {unit}"
    return ""


def schema_at(loc: tuple[int | str, ...], tree: Any) -> tuple[Place, Mapping[str, Any]]:
    """Return the key at `loc`, without pydantic's names of union branches, and its schema.

    If the key is unknown, return the schema of its section.
    """
    schema, place, value = _schema(), [], tree
    for step in loc:
        if isinstance(step, int):
            schema = _item(schema, step)
            place.append(str(step))
            continue
        variant = schema.get("discriminator", {}).get("mapping", {}).get(step)
        if variant is not None:
            schema = follow({"$ref": variant})
            continue
        sections = _variants(schema)
        known = next((s["properties"] for s in sections if step in s.get("properties", {})), None)
        if known is not None:
            schema = follow(known[step])
        elif not (isinstance(value, Mapping) and step in value):
            continue
        place.append(step)
        value = value.get(step) if isinstance(value, Mapping) else None
    return tuple(place), schema


def _item(schema: Mapping[str, Any], number: int) -> Mapping[str, Any]:
    """Return the schema of one item of a list; the schema of the list if its items have no schemas of their own."""
    for branch in schema.get("anyOf", [schema]):
        items = branch.get("prefixItems", ())
        if number < len(items):
            return follow(items[number])
    return schema


def follow(schema: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a schema with its reference resolved; keywords beside the reference have priority."""
    if "$ref" in schema:
        return {**_schema()["$defs"][schema["$ref"].rsplit("/", 1)[1]], **schema}
    return schema
