"""Result of a study: a table for people, the same data for programs, and files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic_core import to_jsonable_python

if TYPE_CHECKING:
    from rich.console import RenderableType


@dataclass(frozen=True, slots=True)
class StudyReport:
    """The result of a study."""

    shown: "RenderableType"
    """Table for people."""
    result: object
    """Result as data for JSON."""
    written: Sequence[Path]
    """Tables and charts."""
    is_good: bool
    """False if an ending occurred that must never occur."""


def reported(
    shown: "RenderableType",
    folder: Path,
    tables: Mapping[str, Sequence[Any]],
    pictures: Sequence[Path] = (),
    is_good: bool = True,
    **facts: Any,
) -> StudyReport:
    """Write tables as CSV and return the report of a study.

    Args:
        shown: Table for people.
        folder: Folder of the CSV files.
        tables: Rows of each CSV file, dataclasses or mappings, by the name of the file.
        pictures: Charts that are already written.
        is_good: False if an ending occurred that must never occur.
        facts: Result for programs, by name; dataclasses become mappings, NaN and infinities null.
    """
    from cell.lab.rows import write_rows

    written = [write_rows(rows, folder / name) for name, rows in tables.items()]
    return StudyReport(shown, to_jsonable_python(facts, inf_nan_mode="null"), [*written, *pictures], is_good)
