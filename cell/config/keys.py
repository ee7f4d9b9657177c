"""Every key of the config: its meaning, unit, range, default, source and reader; pure.

The models are the only source: the docstring of a key is its meaning, `Quantity` in its annotation gives the unit, and `Source` the source of its
figure. For a pure number, a word replaces the unit: "fraction", "ratio", "count". If a key has no source, that of its section or of its class applies.
"""

import inspect
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from cell.config.cell_config import RECIPE_SECTIONS, CellConfig
from cell.config.errors import allowed, follow, schema_at
from cell.config.load import LoadedConfig
from cell.config.parameters import PARAMETERS
from drivers.config_model import Quantity, Source
from skills.plan import figures

_SENTENCE = re.compile(r"(?<!Sec\.)(?<!Eq\.)(?<!Fig\.)(?<=[.!?])\s+(?=[A-Z0-9`\"\[])")


@dataclass(frozen=True, slots=True)
class Key:
    """One key of the config; if a section has several kinds, the key of one kind."""

    name: str
    """Name with its sections, as in `search.speed`."""
    kind: str
    """Kind of the key's section, as in `skin.kind = "can"`; empty if the section has a single kind."""
    meaning: str
    """The docstring."""
    unit: str
    """Unit, or the word that replaces it; empty for values that are not numbers."""
    allowed: str
    """Type and permitted range in words."""
    default: str | None
    """Default as TOML; None if the key is required."""
    sources: tuple[str, ...]
    """Sources of the figure; without a reference "chosen, not measured", or "set for each cell", part or trial."""
    reader: str
    """Module of the class that declares and reads the key."""
    setters: tuple[str, ...]
    """Places that can set the key: always a cell's file, a preset and `--set`; for some keys a recipe or a command's parameter."""
    section: str
    """Class of the key's section."""

    @property
    def summary(self) -> str:
        """Return the first clause of the meaning, which ends in the unit."""
        return first_clause(self.meaning)


@lru_cache(maxsize=1)
def keys() -> tuple[Key, ...]:
    """Return all keys, in the order of the models."""
    return tuple(_keys_of(CellConfig, "", ""))


def find(name: str) -> list[Key]:
    """Return a key in each of its kinds, or all keys of a section."""
    exact = [key for key in keys() if key.name == name]
    return exact or [key for key in keys() if key.name.startswith(f"{name}.")]


@dataclass(frozen=True, slots=True)
class Setting:
    """Value in force of one key."""

    key: Key
    value: Any
    origin: str
    """File or option of the value; `default` if none states it."""


def in_force(loaded: LoadedConfig, recipe: int = 0) -> list[Setting]:
    """Return the value in force of every key of a cell with one of its recipes; unused optional sections are left out."""
    by_section = {(key.name, key.section): key for key in keys()}
    origins = {".".join(place): origin for place, origin in loaded.origins.get(recipe, {}).items()}
    return [
        Setting(by_section[name, section], value, origins.get(name, "default"))
        for name, section, value in _leaves(loaded.recipes[recipe], "")
    ]


@dataclass(frozen=True, slots=True)
class Planned:
    """One figure of a plan."""

    name: str
    """Name with its sections."""
    value: Any
    unit: str
    """Unit, or the word that replaces it."""
    origin: str
    """File or option of the config's value; `default` if none states it, `fixed` if no config can."""
    reasons: tuple[str, ...]
    """Reason why the value in force differs from the config's; empty if they are equal."""
    is_capped: bool
    """True if the arm's limits reduce the value."""


def planned(loaded: LoadedConfig, recipe: int = 0, attempt: int = 0) -> list[Planned]:
    """Return every figure in force for the part of a recipe after `attempt` failed attempts to insert it at one place."""
    plan = loaded.recipes[recipe].plan(attempt)
    origins = {".".join(place): origin for place, origin in loaded.origins.get(recipe, {}).items()}
    by_name = {key.name: key for key in keys()}
    return [
        Planned(
            name=name,
            value=value,
            unit=by_name[name].unit if name in by_name else _unit_of_figure(params, name),
            origin=origins.get(name, "default") if name in by_name else "fixed",
            reasons=plan.reasons.get(name, ()),
            is_capped=name in plan.capped,
        )
        for section, params in plan.sections.items()
        for name, value in figures(params, section).items()
        if value is not None
    ]


def _unit_of_figure(params: BaseModel, name: str) -> str:
    """Return the unit of a figure without a key."""
    *above, last = name.split(".")[1:]
    for step in above:
        params = getattr(params, step)
    return unit_of(type(params).model_fields[last])


def _leaves(model: BaseModel, place: str) -> Iterator[tuple[str, str, Any]]:
    for name in settable(type(model)):
        value = getattr(model, name)
        if isinstance(value, BaseModel):
            yield from _leaves(value, f"{place}{name}.")
        elif value is not None:
            yield f"{place}{name}", type(model).__name__, value


def section_summary(name: str) -> str:
    """Return the first clause of a section's docstring; empty without a docstring."""
    place, schema = schema_at(tuple(name.split(".")), {})
    return first_clause(schema.get("description", "")) if ".".join(place) == name else ""


def _source_of(field: FieldInfo) -> str:
    """Return the source that a key or a section states; empty without one."""
    return next((mark.text for mark in field.metadata if isinstance(mark, Source)), "")


def first_clause(text: str) -> str:
    """Return the first sentence of a docstring up to its first semicolon, without its full stop."""
    return _SENTENCE.split(text)[0].rstrip(".").split(";")[0]


def _keys_of(model: type[BaseModel], place: str, kind: str, source: str = "") -> Iterator[Key]:
    """Yield the keys of a model; `source` is that of its section.

    The source of a key has priority, then that of its section, then that of the class that declares it.
    """
    properties = model.model_json_schema().get("properties", {})
    for name, field in settable(model).items():
        inner = list(_models(field.annotation))
        at, stated = f"{place}{name}", _source_of(field) or source
        if not inner:
            yield _key(at, kind, stated, field, properties[name], model)
        for each in inner:
            chosen = each.model_fields.get("kind")
            values = get_args(chosen.annotation) if chosen is not None and len(inner) > 1 else ()
            yield from _keys_of(each, f"{at}.", f'{at}.kind = "{values[0]}"' if values else kind, stated)


def settable(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """Return the fields of a model that are keys; the others are figures that no config sets."""
    return {name: field for name, field in model.model_fields.items() if not field.exclude}


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the models in an annotation; one model is a section, several are its kinds."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
        return
    for part in get_args(annotation):
        yield from _models(part)


def _key(name: str, kind: str, source: str, field: FieldInfo, schema: Mapping[str, Any], model: type[BaseModel]) -> Key:
    owner = _owner(model, name.rsplit(".", 1)[-1])
    source = source or vars(owner).get("SOURCE", "")
    setters = ["a cell's file", "a preset", "--set"]
    if name.split(".")[0] in RECIPE_SECTIONS:
        setters.append("a recipe")
    for number, parameter in enumerate(PARAMETERS):
        if parameter.name == name:
            setters.append(f"a command, as parameter {number}")
    return Key(
        name=name,
        kind=kind,
        meaning=follow(schema).get("description", ""),
        unit=unit_of(field),
        allowed=allowed(schema),
        default=None if field.is_required() else toml(field.get_default(call_default_factory=True)),
        sources=tuple(source.split("; ")) if source else (),
        reader=owner.__module__,
        setters=tuple(setters),
        section=model.__name__,
    )


def _owner(model: type[BaseModel], field: str) -> type:
    """Return the class that declares a key."""
    return next((base for base in model.__mro__ if field in inspect.get_annotations(base)), model)


def unit_of(field: FieldInfo) -> str:
    """Return the unit of a key or figure, or the word that replaces it; empty without one."""
    return next((mark.unit for mark in field.metadata if isinstance(mark, Quantity)), "")


def toml(value: Any) -> str:
    """Return a value in TOML, as in a config file."""
    if isinstance(value, BaseModel):
        return toml(value.model_dump(mode="json"))
    if isinstance(value, bool | None):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, Mapping):
        inside = ", ".join(f"{key} = {toml(each)}" for key, each in value.items() if each is not None)
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, list | tuple | set | frozenset):
        return f"[{', '.join(toml(each) for each in value)}]"
    return json.dumps(str(value), ensure_ascii=False)
