"""Outcome of a study: tables for people, the same data for programs, and files."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import RenderableType


@dataclass(frozen=True, slots=True)
class StudyReport:
    """The result of a study."""

    tables: "Sequence[RenderableType]"
    result: object
    """Result as data for JSON."""
    written: list[Path] = field(default_factory=list)
    """Tables, figures and charts."""
    is_good: bool = True
    """False if an ending occurred that must never occur."""


def finite(value: Any) -> Any:
    """Return data with null in place of NaN and infinities, which JSON does not have."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
