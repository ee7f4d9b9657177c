"""Turn what pydantic says about a wrong config into one line: file, key, what was found, what is allowed."""

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

Place = tuple[str, ...]


def explain(
    error: ValidationError, model: type[BaseModel], tree: Mapping[str, Any], source: Mapping[Place, str], file: str
) -> str:
    """Return one line about the first thing that is wrong.

    Args:
        error: What pydantic says.
        model: The model that was wanted.
        tree: What was given.
        source: Where each key came from.
        file: Where a key should have come from when it came from nowhere.
    """
    first = error.errors(include_url=False)[0]
    place, schema = _walk(first["loc"], model.model_json_schema(), tree)
    key = ".".join(place)
    origin = next((source[place[:n]] for n in range(len(place), 0, -1) if place[:n] in source), file)
    kind, found = first["type"], first.get("input")
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        tags = ", ".join(f'"{tag}"' for tag in schema["discriminator"]["mapping"])
        if kind == "union_tag_not_found":
            return f"{origin}: {key}.kind: missing; {tags} needed"
        return f"{source.get((*place, 'kind'), origin)}: {key}.kind = {first['ctx']['tag']!r}: {tags} allowed"
    if kind == "missing":
        return f"{file}: {key}: missing; {allowed(schema)} needed"
    if kind == "extra_forbidden":
        names = ", ".join(sorted(schema.get("properties", {})))
        return f"{origin}: {key}: unknown key; {names} allowed"
    if kind == "value_error":
        text = first["msg"].removeprefix("Value error, ")
        if not key:
            # A check across sections names its key itself.
            named = tuple(text.split(" = ")[0].split("."))
            return f"{source.get(named, file)}: {text}"
        within = (*place, *text.split(" = ")[0].split("."))
        if within in source:
            # A check within a section that names its key itself.
            return f"{source[within]}: {key}.{text}"
        return f"{origin}: {key}: {text}"
    return f"{origin}: {key} = {found!r}: {allowed(schema)} allowed{_hint(found, schema)}"


def allowed(schema: Mapping[str, Any]) -> str:
    """Return in words what a JSON schema allows."""
    if "const" in schema:
        return f'"{schema["const"]}"'
    if "enum" in schema:
        return ", ".join(f'"{value}"' for value in schema["enum"])
    if "anyOf" in schema:
        return " or ".join(allowed(branch) for branch in schema["anyOf"] if branch.get("type") != "null")
    if "properties" in schema:
        return f"a section with {', '.join(schema['properties'])}"
    if schema.get("type") == "array":
        inner = schema.get("prefixItems")
        return f"{len(inner)} values, each {allowed(inner[0])}" if inner else "a list"
    word = {"number": "a number", "integer": "an integer", "string": "a text", "boolean": "true or false"}
    name = word.get(schema.get("type", ""), "another value")
    low, high = _bound(schema, "minimum"), _bound(schema, "maximum")
    above, below = _bound(schema, "exclusiveMinimum"), _bound(schema, "exclusiveMaximum")
    parts = []
    if low is not None and high is not None:
        return f"{name} from {low:g} to {high:g}"
    if low is not None or above is not None:
        parts.append(f">= {low:g}" if low is not None else f"> {above:g}")
    if high is not None or below is not None:
        parts.append(f"<= {high:g}" if high is not None else f"< {below:g}")
    return " ".join([name, " and ".join(parts)]).strip()


def _bound(schema: Mapping[str, Any], name: str) -> float | None:
    return schema.get(name)


def _hint(found: Any, schema: Mapping[str, Any]) -> str:
    """Return what to think of when a number is far too large."""
    if isinstance(found, bool) or not isinstance(found, int | float):
        return ""
    for branch in schema.get("anyOf", [schema]):
        high = branch.get("maximum", branch.get("exclusiveMaximum"))
        if branch.get("type") == "number" and high is not None and high < found <= 1000.0 * high:
            return f"; SI units: angles in radians, lengths in metres, {found:g} mm is {found / 1000.0:g}"
    return ""


def _walk(loc: tuple[int | str, ...], root: Mapping[str, Any], tree: Any) -> tuple[Place, Mapping[str, Any]]:
    """Return the key that `loc` means, without pydantic's names of union branches, and the schema found there.

    For a key that the schema does not know, the schema is that of the section around it.
    """
    schema, place, value = _follow(root, root), [], tree
    for step in loc:
        if isinstance(step, int):
            items = [branch for branch in schema.get("anyOf", [schema]) if branch.get("type") == "array"]
            inner = items[0].get("prefixItems", []) if items else []
            if step < len(inner):
                schema = _follow(inner[step], root)
            place.append(str(step))
            continue
        variant = schema.get("discriminator", {}).get("mapping", {}).get(step)
        if variant is not None:
            schema = _follow({"$ref": variant}, root)
            continue
        sections = [_follow(branch, root) for branch in schema.get("anyOf", schema.get("oneOf", [schema]))]
        known = next((s["properties"] for s in sections if step in s.get("properties", {})), None)
        if known is not None:
            schema = _follow(known[step], root)
        elif not (isinstance(value, Mapping) and step in value):
            tags = schema.get("discriminator", {}).get("mapping", {})
            schema = _follow({"$ref": tags[step]}, root) if step in tags else schema
            continue
        place.append(step)
        value = value.get(step) if isinstance(value, Mapping) else None
    return tuple(place), schema


def _follow(schema: Mapping[str, Any], root: Mapping[str, Any]) -> Mapping[str, Any]:
    if "$ref" in schema:
        found: Mapping[str, Any] = root["$defs"][schema["$ref"].rsplit("/", 1)[1]]
        return found
    return schema
