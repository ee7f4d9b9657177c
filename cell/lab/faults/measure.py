"""Faults during an insertion, one after the other, and the result of each."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from cell.config.load import LoadedConfig
from cell.lab.faults import ends
from cell.lab.faults.bench import LIFE_TIMEOUT, PATIENCE, FaultBench, Sighting, bench
from cell.lab.faults.cases import INSERT, FaultCase, Planned, brought_back, word
from cell.lab.faults.contract import FaultKind, Undo
from cell.peg.part_state import IN_HOLE_DEPTH
from cell.run.states import State
from drivers.errors import CellError
from plc_bridge.protocol.messages import PartPlace, Report
from sim.world.situation import PegSituation
from sim.world.truth import Truth
from skills.catalogue import CATALOGUE

CELL_CASES = 10
"""Number of cases for one served cell; then a new cell, with newly drawn errors, replaces it."""
SEEN_ON = 1.5
"""Time of observation of the arm after the run, s."""
MENDED = 2.5
"""Time between repair and reset, s, long enough to detect a board again; a skin's hub needs up to two seconds."""


def measure(
    make: Callable[[int], LoadedConfig],
    tried: Sequence[Planned],
    folder: Path,
    done: int = 0,
    arguments: Callable[[int], Sequence[str]] = lambda number: (),
) -> Iterator[FaultCase]:
    """Run every case except the first `done`, and yield each when it is done.

    Each cell serves several cases, and a new cell replaces one that does not recover.

    Args:
        make: Function that returns the config of the cell with this number.
        tried: The cases.
        folder: Folder for the records of cells that are separate programs; they share it.
        done: Number of cases from earlier calls.
        arguments: Function that returns the arguments of the program that serves the cell with this number.

    Raises:
        CellError: A new cell cannot be created.
    """
    for first in range(done - done % CELL_CASES, len(tried), CELL_CASES):
        batch = tried[max(first, done) : first + CELL_CASES]
        number = first // CELL_CASES
        yield from _served(make(number), batch, arguments(number), folder)


def _served(
    loaded: LoadedConfig, tried: Sequence[Planned], arguments: Sequence[str], folder: Path
) -> Iterator[FaultCase]:
    """Run cases one after the other, and yield each when it is done."""
    with ExitStack() as stack:
        tested: FaultBench | None = None
        life_timeout = LIFE_TIMEOUT if any(kind.silences_plc for kind, _, _ in tried) else PATIENCE
        for kind, stage, moment in tried:
            if kind.to_program is not None:
                stack.close()  # a cell in this process would take processor time from the separate program
                tested = None
            elif tested is None:
                tested = stack.enter_context(bench(loaded, life_timeout))
            try:
                if tested is None:
                    case = ends.tried(kind, stage, moment, arguments, folder)
                else:
                    case = _case(tested, kind, stage, moment)
            except CellError as error:
                case = FaultCase(kind.name, stage, moment, reason=str(error))
            yield case
            if not case.is_back:
                stack.close()
                tested = None


def _case(tested: FaultBench, kind: FaultKind, stage: str, moment: float) -> FaultCase:
    undo: list[Undo | None] = []
    tested.plc_act = None
    tested.let_pass(MENDED)  # the line brings the next workpiece
    tested.arm_fault(stage, moment, lambda: undo.append(kind.begin(tested)))
    try:
        report = tested.run(INSERT)
        has_ended = kind.ends_program and bool(undo)
        if has_ended:
            tested.thread.join()
        outcome = _outcome(tested, report)
        part = _reported_part(tested, report, outcome)
        truth, is_gripping = tested.truth, tested.gripper.device.read().is_gripping
        record = kind.is_record_apart and _is_on_record(tested, report, outcome, kind)
    finally:
        seen, tested.seen, tested.stage = tested.seen, Sighting(), 0
        for mend in filter(None, undo):
            mend()
    state = State(report.state).name
    if has_ended:
        tested.restart()
    record = record or _is_on_record(tested, report, outcome, kind)
    reset, actions, following = bring_back(tested)
    return FaultCase(
        kind=kind.name,
        stage=stage,
        moment=moment,
        outcome=outcome if seen.injected is not None or report.refusal else "not reached",
        reason=CATALOGUE.reasons.get(report.reason, str(report.reason)).lower(),
        fault=report.fault,
        state=state,
        part=part.name.lower(),
        **_times(seen, outcome),
        peak_force=seen.peak_force,
        contact_force=seen.contact_force,
        wrong_success=outcome == "success" and not truth.switch_closed,
        part_untrue=not _is_true(part, truth, is_gripping),
        record=record,
        reset=reset,
        actions=actions,
        following=following,
    )


def _reported_part(tested: FaultBench, report: Report, outcome: str) -> PartPlace:
    """Return the reported position of the peg: after a success at once, before the line removes the workpiece; otherwise later, at rest.

    The delay is needed because a fallen peg, or a switch that has just changed, appears in the report a moment later.
    """
    if outcome == "success":
        return PartPlace(report.part)
    tested.let_pass(SEEN_ON)
    return PartPlace(tested.supervisor.report.part)


def _times(seen: Sighting, outcome: str) -> dict[str, Any]:
    """Return the times and the creep of a detected fault; values without meaning for the outcome are left out."""
    if seen.injected is None or seen.detected is None or outcome == "success":
        return {}
    found = {"detection": seen.detected - seen.injected}
    if outcome == "failure":  # the arm freed itself by its own motions
        return found
    rest, rest_after = max(seen.moved - seen.detected, 0.0), max(seen.moved - seen.injected, 0.0)
    return {**found, "rest": rest, "rest_after": rest_after, "creep": seen.creep}


def _outcome(tested: FaultBench, report: Report) -> str:
    """Return the result that the PLC reads, or the recorded result if the PLC was lost meanwhile."""
    if tested.is_plc_lost and tested.supervisor.last is not None:
        return tested.supervisor.last.outcome
    return word(report)


def _is_true(place: PartPlace, truth: Truth, is_gripping: bool) -> bool:
    """Return True if the peg can be at the reported position; always True if the position is reported as unknown."""
    is_held = truth.peg is PegSituation.HELD or is_gripping
    match place:
        case PartPlace.UNKNOWN:
            return True
        case PartPlace.SEATED:
            return truth.switch_closed
        case PartPlace.IN_HOLE:
            return truth.is_in_hole
        case PartPlace.IN_HAND:
            return is_held and not (truth.is_in_hole and truth.depth >= 2.0 * IN_HOLE_DEPTH)
    return not is_held and not truth.is_in_hole


def _is_on_record(tested: FaultBench, report: Report, outcome: str, kind: FaultKind) -> bool:
    """Return True if the record contains the run with its actual ending."""
    last = tested.supervisor.last
    try:
        row = tested.journal.find(last.run if tested.is_plc_lost and last is not None else report.run)
    except CellError:
        return False
    is_sampled = row.samples > 0 or kind.name.startswith("disk")
    # A fault after the run belongs to the cell and not to the run; the report contains it beside the run's result.
    fault = 0 if outcome == "success" else report.fault
    return bool(row.ended) and row.outcome == outcome and row.fault == fault and is_sampled


def bring_back(tested: FaultBench) -> tuple[str, int, str]:
    """Act as an operator; return the result of the reset, the number of further actions, and the next result."""
    with suppress(CellError):
        tested.let_pass(MENDED)
        return brought_back(tested.peer, lambda: tested.let_pass(MENDED))
    return "", 0, "silent"
