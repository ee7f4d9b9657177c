"""Figures of runs for reports: packed for each run when it ends, unpacked as columns for the runs of a report.

Runs with the same ending and the same stage names are of one kind. A run's figures are 64-bit floats: the values of
`RUN_FIGURES`, then those of `STAGE_FIGURES` for each stage, all tries of a stage together. NaN means not on record.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from struct import pack
from typing import NamedTuple

from cell.records.schema import RunRow, StageRow, ToldRow

RUN_FIGURES = ("started", "cycle_time", "peak_force")
"""Figures of a run: its start, s since 1970, UTC; its cycle time, s; its peak force, N."""
STAGE_FIGURES = ("counted", "whole", "residual")
"""Figures of a stage: sum of the skill's own times, s; sum of the times with transfers, s; largest residual of theta, 0 to 1.
"""


class Kind(NamedTuple):
    """Properties shared by the runs of one kind: columns of their rows, and the names of their stages."""

    outcome: str
    stage: str
    reason: str
    fault: int
    names: list[str]
    """Names of the stages, each once, in the order of their first tries."""


class Told(NamedTuple):
    """Columns of the ended runs of a report, oldest first, one value per run."""

    kind: Sequence[str]
    """Each a `Kind` as JSON."""
    figures: Sequence[bytes]


@dataclass(slots=True)
class _StageSum:
    """Sums over all tries of one stage."""

    counted: float = math.nan
    whole: float = math.nan
    residual: float = math.nan


def told_row(row: RunRow, stages: Sequence[StageRow]) -> ToldRow:
    """Return the report figures of a run that has ended with these tries of its stages."""
    sums: dict[str, _StageSum] = {}
    for stage in stages:
        found = sums.setdefault(stage.name, _StageSum(whole=0.0))
        found.whole += stage.ended - stage.began
        if stage.counted is not None:
            found.counted = stage.counted + (0.0 if math.isnan(found.counted) else found.counted)
        if stage.residual is not None:
            found.residual = stage.residual if math.isnan(found.residual) else max(found.residual, stage.residual)
    kind = json.dumps(Kind(row.outcome, row.stage, row.reason, row.fault, [*sums]), separators=(",", ":"))
    values = [_seconds(row.started), *(math.nan if it is None else it for it in (row.cycle_time, row.peak_force))]
    for found in sums.values():
        values += [found.counted, found.whole, found.residual]
    return ToldRow(row.run, kind, pack(f"<{len(values)}d", *values))


def _seconds(moment: str) -> float:
    try:
        return datetime.fromisoformat(moment).replace(tzinfo=UTC).timestamp()
    except ValueError:
        return math.nan


def told_columns(rows: Sequence[tuple[str, bytes]]) -> Told:
    """Return rows as columns."""
    return Told(*zip(*rows, strict=True)) if rows else Told((), ())
