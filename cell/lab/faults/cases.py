"""Result of one fault, and the table of cases on the disk."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cell.lab.faults.contract import FaultKind
from cell.lab.rows import kept_rows, write_rows
from plc_bridge.messages import Refusal, Report, Result

WENT_ON = ("success", "failure")
"""Endings of an insertion after which production continues."""
TABLE = "faults.csv"
Planned = tuple[FaultKind, str, float]
"""A kind, the stage, and the time from the stage's first scan to the fault, s."""


@dataclass(frozen=True, slots=True)
class FaultCase:
    """Result of one fault."""

    kind: str
    stage: str
    moment: float
    """Time from the stage's first scan to the fault, s."""
    outcome: str
    """Result that the PLC reads; `not reached` if the run ended before the fault was due."""
    reason: str
    fault: int
    state: str
    """State of the cell after the run."""
    part: str
    """Position of the peg in the report."""
    detection: float
    """Time from the fault to its report, s; NaN if the run continued to a success."""
    rest: float
    """Time from the report to the arm's last motion, s; NaN if the run continued to a success or, after a failure, to
    its recovery."""
    rest_after: float
    """Time from the fault to the arm's last motion in the run, s; NaN if it continued as above."""
    creep: float
    """Motion of the hand after the time at which it must be at rest, m; NaN if it continued as above."""
    peak_force: float
    """Largest external force at the TCP after the fault, from the arm's own estimate, N."""
    contact_force: float
    """Largest true net force of plate or hole on the held peg in the run, N."""
    wrong_success: bool
    """True if the PLC reads a success although no peg is seated."""
    part_untrue: bool
    """True if the peg is not at the reported position."""
    record: bool
    """True if the run is recorded to its end, with samples unless the disk was the fault."""
    reset: str
    """Result of the RESET; empty if none was needed."""
    actions: int
    """Number of operator actions after the RESET before the next peg."""
    following: str
    """Result of the next insertion."""

    @property
    def is_back(self) -> bool:
        """True if the cell is back in production after a reset and at most one further action."""
        return self.actions <= 1 and self.following in WENT_ON


SILENT = FaultCase(
    kind="",
    stage="",
    moment=0.0,
    outcome="silent",
    reason="",
    fault=0,
    state="",
    part="unknown",
    detection=math.nan,
    rest=math.nan,
    rest_after=math.nan,
    creep=math.nan,
    peak_force=math.nan,
    contact_force=math.nan,
    wrong_success=False,
    part_untrue=False,
    record=False,
    reset="",
    actions=0,
    following="silent",
)
"""A cell that does not answer any more."""


def word(report: Report) -> str:
    """Return a result, or the reason of a refusal."""
    if report.refusal:
        return f"refused: {Refusal(report.refusal).name.lower()}"
    return Result(report.result).name.lower()


def write(rows: Sequence[FaultCase], folder: Path) -> Path:
    """Write the table, one row per case; return the file."""
    return write_rows(rows, folder / TABLE)


def begun(tried: Sequence[Planned], folder: Path) -> list[FaultCase]:
    """Return the rows that an interrupted call left for these cases; none if the table belongs to others."""
    rows = kept_rows(FaultCase, folder / TABLE)
    same = [
        (row.kind, row.stage, row.moment) == (kind.name, stage, moment)
        for row, (kind, stage, moment) in zip(rows, tried, strict=False)
    ]
    return rows if all(same) and len(rows) <= len(tried) else []
