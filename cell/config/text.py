"""Config files as text: a whole config as TOML, comments with each key's meaning, and the JSON schema of a file; pure."""

import tomllib
from collections.abc import Iterable, Iterator, Mapping, Set
from typing import Any

from cell.config.cell_config import CellConfig
from cell.config.keys import Setting, find, section_summary, toml


def as_toml(settings: Iterable[Setting]) -> str:
    """Return settings as a config file, each with unit and origin."""
    sections: dict[str, list[str]] = {"": []}
    for setting in settings:
        section, _, name = setting.key.name.rpartition(".")
        above = section.split(".")
        for depth in range(1, len(above) + 1):
            sections.setdefault(".".join(above[:depth]), [])
        told = ", ".join(part for part in (setting.key.unit, setting.origin) if part)
        sections[section].append(f"{name} = {toml(setting.value)}  # {told}")
    texts = ["\n".join([f"[{name}]", *lines] if name else lines) for name, lines in sections.items() if lines]
    return "\n\n".join(texts)


def commented(text: str) -> str:
    """Return a config file with the first clause of each key's meaning as a comment; lines with only a comment stay unchanged."""
    return "".join(f"{line}\n" for line in _commented(text))


def _commented(text: str) -> Iterator[str]:
    section, kinds = "", _kinds(tomllib.loads(text))
    for line in text.splitlines():
        bare = line.strip()
        if bare.startswith("[") and bare.rstrip("]") != bare:
            section = bare.strip("[]")
        if not bare or bare[0] in "#[":
            yield line
            continue
        code = _without_comment(line)
        name = ".".join(part for part in (section, code.partition("=")[0].strip()) if part)
        told = _meaning(name, kinds)
        yield f"{code}  # {told}" if told else line


def _meaning(name: str, kinds: Set[str]) -> str:
    """Return the short meaning of a key, for its section's kind in this file; for a whole table, that of the section."""
    found = [key for key in find(name) if key.name == name]
    chosen = [key for key in found if not key.kind or key.kind in kinds]
    return (chosen or found)[0].summary if found else section_summary(name)


def _kinds(tree: Mapping[str, Any], place: str = "") -> set[str]:
    """Return the kind of every section of a file, as in `skin.kind = "can"`."""
    found = {f'{place}kind = "{tree["kind"]}"'} if "kind" in tree else set()
    return found.union(*(_kinds(each, f"{place}{name}.") for name, each in tree.items() if isinstance(each, Mapping)))


def _without_comment(line: str) -> str:
    """Return a line of `key = value` without its comment."""
    for end in [k for k, sign in enumerate(line) if sign == "#"]:
        try:
            tomllib.loads(line[:end])
        except tomllib.TOMLDecodeError:
            continue
        return line[:end].rstrip()
    return line.rstrip()


def file_schema() -> dict[str, Any]:
    """Return the JSON schema of a cell's file, draft 7, for TOML editors.

    No key is required, because a missing one can come from the file's `base` or its preset.
    """
    schema = CellConfig.model_json_schema()
    schema["properties"] = {
        "base": {
            "type": "string",
            "description": "Base file, beside this file or shipped; keys of this file replace its keys.",
        },
        **schema["properties"],
    }
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        **_draft_7(schema),
        "title": "A cell of the tactile insertion cell",
    }


def _draft_7(schema: Any) -> Any:
    """Return a schema in draft 7: `definitions`, `items` for tuples, a reference without other keywords."""
    if isinstance(schema, list):
        return [_draft_7(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    if "$ref" in schema:
        return _reference(schema)
    renamed = {"$defs": "definitions", "prefixItems": "items"}
    left_out = {"discriminator", "required", "title"}
    return {
        renamed.get(name, name): {key: _draft_7(value) for key, value in each.items()}
        if name in ("properties", "$defs")
        else _draft_7(each)
        for name, each in schema.items()
        if name not in left_out
    }


def _reference(schema: Mapping[str, Any]) -> dict[str, Any]:
    target = {"$ref": schema["$ref"].replace("#/$defs/", "#/definitions/")}
    beside = {name: schema[name] for name in ("description", "default") if name in schema}
    return {"allOf": [target], **beside} if beside else target
