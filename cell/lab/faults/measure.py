"""One fault after the other in the middle of an insertion, and what becomes of it."""

import csv
import math
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

from cell.config import LoadedConfig
from cell.lab.faults.bench import FaultBench, Sighting, bench
from cell.lab.faults.kinds import FaultKind
from cell.states import State
from drivers.errors import CellError
from plc_bridge.images import ReportImage
from plc_bridge.messages import Control, PartPlace, Refusal, Result
from skills.catalogue import CATALOGUE

TABLE = "faults.csv"
STAGES = ("grasp_from_rack", "spray_search", "tactile_insert", "spiral_adjust")
MOMENTS = (0.05, 0.3, 1.0)
"""Times from the first scan of a stage to the fault, s."""
QUICK_STAGES, QUICK_MOMENTS = ("grasp_from_rack", "spray_search"), (0.3,)
LONGEST = 600.0
"""Longest wait for one command, s of wall time."""
SEEN_ON = 0.3
"""Time for which the arm is looked at after the run, s of wall time."""
MENDED = 0.5
"""Time between mending and the reset, s of wall time, in which a board is found again."""
_INSERT, _RECOVER = CATALOGUE["insert_peg"].code, CATALOGUE["recover"].code


@dataclass(frozen=True, slots=True)
class FaultCase:
    """What becomes of one fault."""

    kind: str
    stage: str
    moment: float
    """Time from the stage's first scan to the fault, s."""
    outcome: str
    """Result that the PLC reads; `not reached` where the run ended before the fault was due."""
    reason: str
    fault: int
    state: str
    """State of the cell after the run."""
    part: str
    """Where the report says the peg is."""
    detection: float
    """Time from the fault to its report, s; NaN where the run went on to a success."""
    rest: float
    """Time from the report to the arm's last motion, s; NaN where the run went on to a success."""
    rest_after: float
    """Time from the fault to the arm's last motion in the run, s; NaN where the run went on to a success."""
    peak_force: float
    """Largest external force at the TCP from the fault on, by the arm's own estimate, N."""
    wrong_success: bool
    """Whether the PLC reads a success although no peg is seated."""
    record: bool
    """Whether the run is on record to its end, with samples unless the disk was the fault."""
    reset: str
    """Result of the RESET; empty where none was needed."""
    actions: int
    """Number of actions of an operator beside the RESET before the next peg."""
    following: str
    """Result of the next insertion."""

    @property
    def is_back(self) -> bool:
        """Whether the cell is back in production after a reset and at most one action more."""
        return self.actions <= 1 and self.following in ("success", "failure")


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
    peak_force=math.nan,
    wrong_success=False,
    record=False,
    reset="",
    actions=0,
    following="silent",
)
"""A cell that no longer answers."""


def cases(kinds: Sequence[FaultKind], is_quick: bool) -> list[tuple[FaultKind, str, float]]:
    """Return what is tried, kind by kind."""
    stages, moments = (QUICK_STAGES, QUICK_MOMENTS) if is_quick else (STAGES, MOMENTS)
    return [(kind, stage, moment) for kind in kinds for stage in stages for moment in moments]


def measure(
    loaded: LoadedConfig, tried: Sequence[tuple[FaultKind, str, float]], watch: Callable[[FaultCase], None]
) -> list[FaultCase]:
    """Try every case on one served cell; a cell that does not come back is exchanged for a new one.

    Raises:
        CellError: A new cell cannot be made.
    """
    found: list[FaultCase] = []
    with ExitStack() as stack:
        tested: FaultBench | None = None
        for kind, stage, moment in tried:
            if tested is None:
                tested = stack.enter_context(bench(loaded))
            try:
                case = _case(tested, kind, stage, moment)
            except CellError as error:
                case = replace(SILENT, kind=kind.name, stage=stage, moment=moment, reason=str(error))
            found.append(case)
            watch(case)
            if not case.is_back:
                stack.close()
                tested = None
    return found


def write(rows: Sequence[FaultCase], folder: Path) -> Path:
    """Write the table, one row a case; return the file."""
    with (folder / TABLE).open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, [field.name for field in fields(FaultCase)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    return folder / TABLE


def _case(tested: FaultBench, kind: FaultKind, stage: str, moment: float) -> FaultCase:
    undo: list[Callable[[], None]] = []
    threading.Event().wait(MENDED)  # the line brings the next workpiece
    tested.arm_fault(stage, moment, lambda: undo.append(kind.begin(tested)))
    try:
        report = tested.peer.run(_INSERT, timeout=LONGEST)
        if kind.ends_program and undo:
            tested.thread.join()
        is_seated = _is_seated(tested)
        threading.Event().wait(SEEN_ON)
    finally:
        seen, tested.seen, tested.stage = tested.seen, Sighting(), 0
        for mend in undo:
            mend()
    state = State(report.state).name
    if kind.ends_program and undo:
        tested.restart()
    went_on = seen.injected is None or report.result == Result.SUCCESS or seen.detected is None
    record = _is_on_record(tested, report, kind)
    reset, actions, following = _bring_back(tested)
    return FaultCase(
        kind=kind.name,
        stage=stage,
        moment=moment,
        outcome=_word(report) if seen.injected is not None or report.refusal else "not reached",
        reason=CATALOGUE.reasons.get(report.reason, str(report.reason)).lower(),
        fault=report.fault,
        state=state,
        part=PartPlace(report.part).name.lower(),
        detection=math.nan if went_on else (seen.detected or 0.0) - (seen.injected or 0.0),
        rest=math.nan if went_on else max(seen.moved - (seen.detected or 0.0), 0.0),
        rest_after=math.nan if went_on else max(seen.moved - (seen.injected or 0.0), 0.0),
        peak_force=seen.peak_force,
        wrong_success=report.result == Result.SUCCESS and not is_seated,
        record=record,
        reset=reset,
        actions=actions,
        following=following,
    )


def _is_seated(tested: FaultBench) -> bool:
    """Tell whether a peg really is at the bottom of the hole."""
    truth = tested.cell.truth
    assert truth is not None
    return truth().switch_closed


def _is_on_record(tested: FaultBench, report: ReportImage, kind: FaultKind) -> bool:
    try:
        row = tested.journal.find(report.run)
    except CellError:
        return False
    return bool(row.ended) and row.outcome != "running" and (row.samples > 0 or kind.name.startswith("disk"))


def _bring_back(tested: FaultBench) -> tuple[str, int, str]:
    """Do as an operator does; return the result of the reset, the number of further actions, and the next result."""
    threading.Event().wait(MENDED)
    reset, actions = "", 0
    with suppress(CellError):
        if tested.supervisor.state in (State.ABORTED, State.STOPPED):
            reset = _word(tested.peer.run(Control.RESET, timeout=LONGEST))
        threading.Event().wait(MENDED)
        following = tested.peer.run(_INSERT, timeout=LONGEST)
        while (following.refusal or following.result in (Result.FAULT, Result.ABORTED)) and actions < 2:
            actions += 1
            if tested.supervisor.state in (State.ABORTED, State.STOPPED):
                tested.peer.run(Control.RESET, timeout=LONGEST)
            # What the hand does not hold after all a person takes away.
            tested.peer.run(_RECOVER if actions == 1 else Control.CLEARED, timeout=LONGEST)
            following = tested.peer.run(_INSERT, timeout=LONGEST)
        return reset, actions, _word(following)
    return reset, actions, "silent"


def _word(report: ReportImage) -> str:
    """Return a result, or why a command was refused."""
    if report.refusal:
        return f"refused: {Refusal(report.refusal).name.lower()}"
    return Result(report.result).name.lower()
