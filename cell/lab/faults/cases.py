"""Result of one fault, the cases of a campaign, and the operator's actions after a case; nothing is measured here."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count, islice
from pathlib import Path

import numpy as np

from cell.lab.faults.contract import FaultKind
from cell.lab.rows import kept_rows
from cell.records.provenance import versions
from cell.run.states import State
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import Control, PartEvidence, Refusal, Report, Result
from skills.catalogue import CATALOGUE

TABLE = "faults.csv"
WENT_ON = ("success", "failure")
"""Endings of an insertion after which production continues."""
STAGES: dict[str, tuple[float, float]] = {
    "grasp_from_rack": (0.3, 4.2),
    "spray_search": (0.5, 3.8),
    "tactile_insert": (0.05, 1.3),
    "spiral_adjust": (0.05, 0.9),
    "release_and_retract": (0.05, 0.8),
}
"""Earliest and latest fault after the first scan of each stage, s: in motion, in contact, or while the fingers move."""
TURNS = 4
"""Number of cases of each kind at each stage in a whole campaign."""
LONGEST = 600.0
"""Longest wait for one command, s of wall time."""
MOST_ACTIONS = 2
"""Number of actions after the reset before the operator gives up."""
INSERT, RECOVER = CATALOGUE["insert_peg"].code, CATALOGUE["recover"].code
Planned = tuple[FaultKind, str, float]
"""A kind, the stage, and the time from the stage's first scan to the fault, s."""


@dataclass(frozen=True, slots=True)
class FaultCase:
    """Result of one fault; the defaults describe a cell that does not answer any more."""

    kind: str
    stage: str
    moment: float
    """Time from the stage's first scan to the fault, s."""
    outcome: str = "silent"
    """Result that the PLC reads; `not reached` if the run ended before the fault was due."""
    reason: str = ""
    fault: int = 0
    state: str = ""
    """State of the cell after the run."""
    part: str = "unknown"
    """Position of the peg in the report."""
    detection: float = math.nan
    """Time from the fault to its report, s; NaN if the run continued to a success."""
    rest: float = math.nan
    """Time from the report to the arm's last motion, s; NaN if the run continued, to a success or to a failure with its
    recovery."""
    rest_after: float = math.nan
    """Time from the fault to the arm's last motion in the run, s; NaN in the same cases as `rest`."""
    creep: float = math.nan
    """Motion of the hand after the time at which it must be at rest, m; NaN in the same cases as `rest`."""
    peak_force: float = math.nan
    """Largest external force at the TCP after the fault, from the arm's own estimate, N."""
    contact_force: float = math.nan
    """Largest true net force of plate or hole on the held peg in the run, N."""
    wrong_success: bool = False
    """True if the PLC reads a success although no peg is seated."""
    part_untrue: bool = False
    """True if the peg is not at the reported position."""
    record: bool = False
    """True if the record of the run is complete; samples can be missing only if the fault was in the disk."""
    reset: str = ""
    """Result of the RESET; empty if none was needed."""
    actions: int = 0
    """Number of operator actions after the RESET before the next peg."""
    following: str = "silent"
    """Result of the next insertion."""
    cycle: float = math.nan
    """99th percentile of the duration of the PLC's cycles while a fault from outside lasted, s of wall time."""
    code: str = field(default_factory=lambda: versions()["code"])
    """Fingerprint of the code that ran."""

    @property
    def is_back(self) -> bool:
        """True if the cell is back in production after a reset and at most one further action."""
        return self.actions <= 1 and self.following in WENT_ON


def planned(kinds: Sequence[FaultKind], number: int, seed: int) -> list[Planned]:
    """Return `number` cases at random moments.

    Every kind occurs once before any kind occurs again, and a kind occurs at every stage before it occurs again at any stage.
    """
    return list(islice(_drawn(kinds, np.random.default_rng(seed)), number))


def _drawn(kinds: Sequence[FaultKind], rng: np.random.Generator) -> Iterator[Planned]:
    stages = list(STAGES)
    orders = {kind.name: rng.permutation(len(stages)) for kind in kinds}
    for turn in count():
        for index in rng.permutation(len(kinds)):
            stage = stages[orders[kinds[index].name][turn % len(stages)]]
            yield kinds[index], stage, round(float(rng.uniform(*STAGES[stage])), 3)


def begun(tried: Sequence[Planned], folder: Path) -> list[FaultCase]:
    """Return the rows of an interrupted call; none if the table is for other cases or other code."""
    rows, code = kept_rows(FaultCase, folder / TABLE), versions()["code"]
    same = [
        (row.kind, row.stage, row.moment, row.code) == (kind.name, stage, moment, code)
        for row, (kind, stage, moment) in zip(rows, tried, strict=False)
    ]
    return rows if all(same) and len(rows) <= len(tried) else []


def word(report: Report) -> str:
    """Return a result, or the reason of a refusal."""
    if report.refusal:
        return f"refused: {Refusal(report.refusal).name.lower()}"
    return Result(report.result).name.lower()


def brought_back(peer: Peer, wait: Callable[[], None] = lambda: None) -> tuple[str, int, str]:
    """Bring a cell back into production, from the PLC's readings alone.

    Args:
        peer: The PLC, which holds the lease.
        wait: Function that waits some time after the reset.

    Returns:
        Result of the reset, number of further actions, and result of the next insertion.

    Raises:
        CellError: The cell does not answer.
    """
    reset, actions = reset_if_needed(peer), 0
    wait()
    following = peer.run(INSERT, timeout=LONGEST)
    while (following.refusal or following.result in (Result.FAULT, Result.ABORTED)) and actions < MOST_ACTIONS:
        actions += 1
        reset_if_needed(peer)
        peer.run(remedy(following), timeout=LONGEST)
        following = peer.run(INSERT, timeout=LONGEST)
    return reset, actions, word(following)


def reset_if_needed(peer: Peer) -> str:
    """Reset a cell if the cell requires a reset; return the result, or an empty text if no reset was needed."""
    if peer.look().state not in (State.ABORTED, State.STOPPED):
        return ""
    return word(peer.run(Control.RESET, timeout=LONGEST))


def remedy(report: Report) -> int:
    """Return the operator's action after a refusal or a fault: RECOVER if the hand holds a peg, else CLEARED."""
    return RECOVER if report.part_evidence & PartEvidence.HAND_HOLDS else Control.CLEARED
