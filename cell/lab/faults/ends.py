"""Signals and starvation: the cell as a separate program in real time, disturbed from outside during an insertion."""

import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from cell.lab.faults.bench import PATIENCE
from cell.lab.faults.cases import SILENT, FaultCase, word
from cell.lab.faults.contract import FaultKind
from cell.lab.faults.kills import CYCLE, ENDING, LAST, LEFT, LONGEST, Seen
from cell.lab.faults.operator import brought_back
from cell.lab.faults.starts import Program, served
from cell.records.journal import Journal
from cell.records.samples import read_samples
from cell.records.schema import LOST, RUNNING, RunRow
from cell.run.states import State
from drivers.errors import CellError
from plc_bridge.messages import PartPlace, Result
from plc_bridge.peer import Peer
from skills.catalogue import CATALOGUE
from skills.rest import REST_SPEED

ENDS = {signal.SIGTERM: 0, signal.SIGINT: 0, signal.SIGHUP: 0, signal.SIGKILL: -signal.SIGKILL}
"""Signals that end the program, with the required exit status of each."""
HELD_UP = 0.5
"""Time for which the program is stopped or starved, s of wall time."""
BUSY = "import time; end = time.monotonic() + {:g}\nwhile time.monotonic() < end: pass"
BUSY_EACH = 8
"""Number of programs per processor that starve the cell."""
_INSERT = CATALOGUE["insert_peg"].code


def _sent(number: signal.Signals) -> Callable[[Program], None]:
    return lambda program: program.signal(number)


def _paused(program: Program) -> None:
    """Stop and continue the program, as a terminal or a debugger does."""
    program.signal(signal.SIGSTOP)
    time.sleep(HELD_UP)
    program.signal(signal.SIGCONT)


def _starved(program: Program) -> None:
    """Run many programs that compete with the cell for every processor."""
    number = BUSY_EACH * (os.cpu_count() or 1)
    busy = [subprocess.Popen([sys.executable, "-S", "-c", BUSY.format(HELD_UP)]) for _ in range(number)]
    for each in busy:
        each.wait()


PROCESS_KINDS: tuple[FaultKind, ...] = (
    *(
        FaultKind(f"process: {number.name}", to_program=_sent(number), ends_program=True, status=status)
        for number, status in ENDS.items()
    ),
    FaultKind("process: stopped and continued", to_program=_paused),
    FaultKind("process: starved", to_program=_starved),
)
"""All kinds of faults of the program as a process."""


def tried(kind: FaultKind, stage: str, moment: float, arguments: Sequence[str]) -> FaultCase:
    """Serve a cell, cause the fault `moment` seconds after `stage` begins, and check the record and further production.

    Args:
        kind: A kind with `to_program`.
        stage: Name of the stage.
        moment: Time from the stage's first report to the fault, s of wall time.
        arguments: Further arguments of the served cell.

    Raises:
        CellError: The cell does not start, or does not answer.
    """
    assert kind.to_program is not None
    arguments = [*arguments, "--set", f"plc.life_timeout={PATIENCE:g}"]
    with TemporaryDirectory() as name:
        folder, seen = Path(name), Seen()
        status: int | None = None  # of a program that continues, or does not end
        with served(folder, arguments) as program, closing(Peer(*program.address)) as peer:
            is_due = _lead_to(peer, stage, moment, seen)
            told, kept = seen.lives[-1][1] if seen.lives else 0, seen.scans_before(LAST)
            kind.to_program(program)
            if kind.ends_program:
                with suppress(CellError):
                    status = program.wait(ENDING)
            else:
                _follow(peer, seen)
                back = brought_back(peer)
        with Journal(folder) as journal:  # closes open runs of the program, as its next start does
            row = journal.find(seen.run)
        now = seen.part.name.lower()
        if kind.ends_program:
            with (
                served(folder, [*arguments, "--set", "sim.pace=max"]) as program,
                closing(Peer(*program.address)) as peer,
            ):
                now = PartPlace(peer.look().part).name.lower()
                peer.connect()
                peer.take()
                back = brought_back(peer)
        case = _on_record(row, folder, told, kept)
        assert seen.report is not None
        return replace(
            case,
            kind=kind.name,
            stage=stage,
            moment=moment,
            outcome=case.outcome if is_due else "not reached",
            state=State(seen.report.state).name,
            part=seen.part.name.lower(),
            part_untrue=kind.ends_program and now not in LEFT[seen.part.name.lower()],
            record=case.record and status == kind.status,
            reset=back[0],
            actions=back[1],
            following=back[2],
        )


def _lead_to(peer: Peer, stage: str, moment: float, seen: Seen) -> bool:
    """Run an insertion to a time after a stage's first report, s; return True if it gets there before it ends.

    Raises:
        CellError: The cell refuses it, does not answer or does not reach the stage.
    """
    number, entered, deadline = CATALOGUE.stage_number(stage), math.inf, time.monotonic() + LONGEST
    peer.connect()
    peer.take()
    report = peer.trigger(_INSERT)
    while (now := time.monotonic()) < deadline and not report.refusal:
        if report.run:
            seen.see(report)
        if report.result != Result.NONE:
            return False
        if report.stage == number:
            entered = min(entered, now)
        if now >= entered + moment:
            return True
        time.sleep(CYCLE)
        report = peer.cycle()
    raise CellError(f"the insertion does not come to {stage}: {word(report)}")


def _follow(peer: Peer, seen: Seen) -> None:
    """Record the reports of the run until it ends.

    Raises:
        CellError: The cell does not answer.
    """
    seen.see(peer.wait_for_result(LONGEST, seen.see))
    peer.acknowledge()


def _on_record(row: RunRow, folder: Path, told: int, kept: int) -> FaultCase:
    """Return the record of a run.

    Args:
        row: Its row.
        folder: Folder of the journal.
        told: Number of its scans that the PLC had read at the time of the fault.
        kept: Number of its scans that must be recorded.
    """
    columns = read_samples(folder / f"run-{row.run:06d}.arrows")
    stamps = columns["stamp"]
    forces = np.linalg.norm(np.column_stack([columns[f"force_{axis}"] for axis in "xyz"]), axis=1)
    moving = stamps[np.max(np.abs(columns["velocities"]), axis=1) > REST_SPEED] if stamps.size else stamps
    is_ended = row.outcome in ("aborted", "fault")
    since = stamps[min(told, stamps.size - 1)] if stamps.size else math.nan
    return replace(
        SILENT,
        outcome=row.outcome,
        reason=row.reason,
        fault=row.fault,
        rest_after=max(float(moving[-1] - since), 0.0) if is_ended and moving.size else math.nan,
        peak_force=float(np.max(forces[told:], initial=0.0)),
        # A run killed in its first second can have no record except its row.
        record=bool(row.ended) and row.outcome != RUNNING and stamps.size >= max(kept, row.outcome != LOST),
    )
