"""Tables of the laboratory as CSV, and statistics that accept empty data; nothing is measured here."""

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import TypeAdapter

from cell.records.statistics import Z95
from skills.contract import Outcome


class Ended(Protocol):
    """A row with the outcome of a trial."""

    @property
    def outcome(self) -> str:
        """Outcome of the trial, as in `Outcome`."""


Row = TypeVar("Row")
Outcomes = TypeVar("Outcomes", bound=Ended)


def write_rows(rows: Iterable[Any], path: Path) -> Path:
    """Write dataclasses or mappings, one row each, with the fields of the first row as columns; return the file."""
    cells = [asdict(row) if is_dataclass(row) and not isinstance(row, type) else row for row in rows]
    with path.open("w", newline="", encoding="utf-8") as file:
        if cells:
            writer = csv.DictWriter(file, list(cells[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(cells)
    return path


def kept_rows(kind: type[Row], path: Path) -> list[Row]:
    """Return the rows of the dataclass `kind` from the file of an interrupted call; none if the file is missing or has other columns."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return TypeAdapter(list[kind]).validate_python(list(csv.DictReader(file)))  # type: ignore[valid-type]
    except (OSError, ValueError):
        return []


def successes(rows: Iterable[Outcomes]) -> list[Outcomes]:
    """Return the rows of successful trials."""
    return [row for row in rows if row.outcome == Outcome.SUCCESS]


def known(values: Iterable[float | None]) -> list[float]:
    """Return the values other than None and NaN."""
    return [value for value in values if value is not None and not math.isnan(value)]


def average(values: ArrayLike) -> float:
    """Return the mean; NaN without values."""
    found = np.asarray(values, dtype=float)
    return float(found.mean()) if found.size else math.nan


def average_error(values: Sequence[float]) -> float:
    """Return half the 95 % interval of the mean, by the normal distribution; NaN for fewer than two values."""
    return Z95 * float(np.std(values, ddof=1)) / math.sqrt(len(values)) if len(values) > 1 else math.nan


def quantile(values: ArrayLike | Sequence[float], share: float) -> float:
    """Return a quantile, linear between values; NaN without values."""
    found = np.asarray(values, dtype=float)
    return float(np.quantile(found, share)) if found.size else math.nan
