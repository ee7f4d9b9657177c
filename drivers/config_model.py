"""The base of every config model, and the resolution of file names in a config; independent of parts and devices."""

import ast
import inspect
import sys
from dataclasses import dataclass
from enum import Enum
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, NoReturn

from pydantic import AfterValidator, BaseModel, ConfigDict, GetJsonSchemaHandler, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticKnownError, PydanticOmit, core_schema


def beside_config(path: Path, info: ValidationInfo) -> Path:
    """Return the complete path; a relative path starts at the folder of the config file under validation."""
    folder: Path | None = (info.context or {}).get("folder")
    return path if folder is None else folder / path


FilePath = Annotated[Path, AfterValidator(beside_config)]
"""Path of a file; a relative path starts at the folder of the config file, not at the working directory."""


class Tempo(Enum):
    """Effect of the key `speed_scale` on a figure."""

    SPEED = "multiplied"
    WAIT = "divided"
    LIMIT = "divided below 1"
    """Longest time of a motion: a slower plan gets more time, a faster plan gets the same time."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """Unit of a figure, and the effect of the key `speed_scale` on it."""

    unit: str
    """SI unit."""
    tempo: Tempo | None = None
    """Effect of the key `speed_scale`; None for none."""
    radius: str = ""
    """Name of the figure of the same model with the radius, m, of the circle on which the hand moves at a rate in rad/s.

    The name is empty if the hand itself turns at this rate.
    """


@dataclass(frozen=True, slots=True)
class Source:
    """Source of a key's figure. The source of a section holds for its keys without one, `SOURCE` of a class for the rest."""

    text: str
    """References, pages, commands, or "assumed", separated by semicolons."""


class Figure(Quantity):
    """Figure of a plan that no config can set: it has a value, but no key. Its annotation must have `Field(exclude=True)`."""

    __slots__ = ()

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        """Refuse the figure in a config as an unknown key."""
        return core_schema.no_info_plain_validator_function(_unknown)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: Any) -> JsonSchemaValue:
        """Leave the figure out of the schema."""
        raise PydanticOmit


def _unknown(value: object) -> NoReturn:
    raise PydanticKnownError("extra_forbidden")


class ConfigModel(BaseModel):
    """Base of every config model: frozen, unknown keys are errors, no infinities; a key's docstring is its help.

    `Quantity` in a key's annotation gives its unit. The first clause of a docstring gives the key's meaning. A docstring
    becomes the description in the JSON schema, and is read only when a schema is requested. Pydantic's own
    `use_attribute_docstrings` parses every source file at every start, which would double the time of `cell map`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """Return the JSON schema, each key with its docstring as description."""
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema).get("properties", {})
        for base in reversed(cls.__mro__):
            for name, text in _docstrings(base).items():
                if name in properties:
                    properties[name]["description"] = text
        return schema


def _docstrings(cls: type) -> dict[str, str]:
    """Return the docstring of each key that a class itself declares, as one line; empty for a class created at run time."""
    if not issubclass(cls, BaseModel) or cls.__module__ not in sys.modules:
        return {}
    return _module_docstrings(cls.__module__).get(cls.__name__, {})


@cache
def _module_docstrings(module: str) -> dict[str, dict[str, str]]:
    """Return, for every class of a module, the string below each annotated name."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (OSError, TypeError):
        return {}
    return {
        found.name: {
            above.target.id: " ".join(inspect.cleandoc(below.value.value).split())
            for above, below in pairwise(found.body)
            if isinstance(above, ast.AnnAssign)
            and isinstance(above.target, ast.Name)
            and isinstance(below, ast.Expr)
            and isinstance(below.value, ast.Constant)
            and isinstance(below.value.value, str)
        }
        for found in tree.body
        if isinstance(found, ast.ClassDef)
    }
