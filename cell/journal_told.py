"""What reports tell of runs: packed for each run when it ends, unpacked as columns for all runs that a report is about.

Runs whose ends and stages are called the same are of one kind. A run's figures are 64-bit floats, the values of `RUN_FIGURES` and then those of `STAGE_FIGURES` for each of its stages,
all tries of a stage together; NaN stands for what is not on record.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from struct import pack
from typing import NamedTuple

from cell.journal_schema import RunRow, StageRow, ToldRow

RUN_FIGURES = ("started", "cycle_time", "peak_force")
"""Figures of a run: its start in seconds since 1970, UTC, and as in its row, s and N."""
STAGE_FIGURES = ("counted", "whole", "residual")
"""Sum of the times that the skill counts as its own, s; sum of the times with the way to its place, s, unknown in
journals of layout 1; largest residual of theta, 0 to 1.
"""


class Kind(NamedTuple):
    """What runs of one kind have in common: columns of their rows, and the names of their stages."""

    outcome: str
    stage: str
    reason: str
    fault: int
    names: list[str]
    """Names of the stages, each once, in the order of their first tries."""


class Told(NamedTuple):
    """Columns of the runs that have ended and that a report is about, oldest first: one value for each run."""

    kind: Sequence[str]
    """Each a `Kind` as JSON."""
    figures: Sequence[bytes]


@dataclass(slots=True)
class _StageSum:
    """All tries of one stage."""

    counted: float = math.nan
    whole: float = math.nan
    residual: float = math.nan


def told_row(row: RunRow, stages: Sequence[StageRow]) -> ToldRow:
    """Return what reports tell of a run that has ended with these tries of its stages.

    Of a run without any, as those in journals of layout 1, the times in its row are taken.
    """
    sums: dict[str, _StageSum] = {}
    for stage in stages:
        found = sums.setdefault(stage.name, _StageSum(whole=0.0))
        found.whole += stage.ended - stage.began
        if stage.counted is not None:
            found.counted = stage.counted + (0.0 if math.isnan(found.counted) else found.counted)
        if stage.residual is not None:
            found.residual = stage.residual if math.isnan(found.residual) else max(found.residual, stage.residual)
    if not stages:
        for name, time in _stage_times(row.stage_times):
            sums[name] = _StageSum(time)
    kind = json.dumps(Kind(row.outcome, row.stage, row.reason, row.fault, [*sums]), separators=(",", ":"))
    values = [_seconds(row.started), *(math.nan if it is None else it for it in (row.cycle_time, row.peak_force))]
    for found in sums.values():
        values += [found.counted, found.whole, found.residual]
    return ToldRow(row.run, kind, pack(f"<{len(values)}d", *values))


def _stage_times(text: str) -> list[tuple[str, float]]:
    try:
        return [(str(name), float(time)) for name, time in json.loads(text)]
    except (ValueError, TypeError):
        return []  # the record is damaged


def _seconds(moment: str) -> float:
    try:
        return datetime.fromisoformat(moment).replace(tzinfo=UTC).timestamp()
    except ValueError:
        return math.nan


def told_columns(rows: Sequence[tuple[str, bytes]]) -> Told:
    """Return rows as columns."""
    return Told(*zip(*rows, strict=True)) if rows else Told((), ())
