"""The cell as a separate program, ended, starved, attacked or left without disk space during an insertion."""

import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from cell.lab.faults import attacks
from cell.lab.faults.bench import CYCLE, PATIENCE
from cell.lab.faults.cases import INSERT, LONGEST, FaultCase, brought_back, remedy, reset_if_needed, word
from cell.lab.faults.contract import FaultKind, Undo
from cell.lab.faults.program import ServedProgram, certificate, served
from cell.records.journal import Journal
from cell.records.sample_blocks import BATCH
from cell.records.samples import read_samples
from cell.records.schema import LOST, RUNNING, RunRow
from cell.run.states import State
from drivers.errors import CellError
from drivers.quantities import Vector
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import PartPlace, Report, Result, Warnings
from skills.catalogue import CATALOGUE
from skills.guards.rest import REST_SPEED

LAST = 1.0
"""Time before the end of a program in which its samples can be lost, s of wall time."""
ENDING = 30.0
"""Longest wait for the end of a program after a request, s of wall time."""
RECORDED = 60.0
"""Longest time until a run is on record after its end, s of wall time."""
WARNED = 3.0
"""Longest time from the end of a run to its warning, s of wall time."""
SCAN_RATE = 100.0
"""Number of scans that the cell's life counter counts in one second of the cell's clock."""
STARTS = 5
"""Number of attempts to start an insertion, each after the reset or remedy that the refusal requires."""
ENDS = {signal.SIGTERM: 0, signal.SIGINT: 0, signal.SIGHUP: 0, signal.SIGKILL: -signal.SIGKILL}
"""Signals that end the program, with the required exit status of each."""
HELD_UP = 0.5
"""Time for which the program is stopped, starved or attacked, s of wall time."""
BUSY = f"import time; end = time.monotonic() + {HELD_UP:g}\nwhile time.monotonic() < end: pass"
BUSY_EACH = 8
"""Number of programs per processor that starve the cell."""
LEFT = {
    "rack": ("rack", "unknown"),
    "in_hand": ("unknown",),
    "in_hole": ("in_hole", "unknown"),
    "seated": ("rack", "unknown"),
    "bin": ("bin", "rack", "unknown"),
    "on_plate": ("on_plate",),
    "unknown": ("unknown",),
}
"""Positions of the peg that the next start can report, by the last reported position. The peg can move in the moment before
the end of the program, and the position of a held peg is unknown once the hand is empty."""


def _paused(program: ServedProgram) -> Undo:
    """Stop and continue the program, as a terminal or a debugger does."""
    program.signal(signal.SIGSTOP)
    time.sleep(HELD_UP)
    program.signal(signal.SIGCONT)
    return lambda: None


def _starved(program: ServedProgram) -> Undo:
    """Run many programs that compete with the cell for every processor."""
    number = BUSY_EACH * (os.cpu_count() or 1)
    for each in [subprocess.Popen([sys.executable, "-S", "-c", BUSY]) for _ in range(number)]:
        each.wait()
    return lambda: None


def _attacked(attack: attacks.Attack, program: ServedProgram) -> Undo:
    attacks.in_process(attack, program.secure if attack.needs_tls else program.address, HELD_UP)
    return lambda: None


def _full(then: Callable[[ServedProgram], None], program: ServedProgram) -> Undo:
    """Make the disk appear full to the program, and call `then` once the run has ended."""
    program.limit(0)
    return lambda: then(program)


PROGRAM_KINDS: tuple[FaultKind, ...] = (
    *(
        FaultKind(f"process: {number.name}", to_program=partial(ServedProgram.signal, number=number), status=status)
        for number, status in ENDS.items()
    ),
    FaultKind("process: stopped and continued", to_program=_paused, is_timed=True),
    FaultKind("process: starved", to_program=_starved, is_timed=True),
    FaultKind("disk: full, then room again", to_program=partial(_full, ServedProgram.limit), is_harmless=True),
    *(
        FaultKind(
            f"disk: full, then {number.name}",
            to_program=partial(_full, partial(ServedProgram.signal, number=number)),
            status=ENDS[number],
        )
        for number in (signal.SIGTERM, signal.SIGKILL)
    ),
    *(
        FaultKind(
            f"line: {name}",
            to_program=partial(_attacked, attack),
            is_timed=True,
            needs_tls=attack.needs_tls,
            is_harmless=True,
        )
        for name, attack in attacks.ATTACKS.items()
    ),
)
"""All kinds of faults of the program as a process, and of its neighbours on the network."""


@dataclass(slots=True)
class Seen:
    """A PLC's readings of a run."""

    report: Report = field(default_factory=Report)
    """The last report."""
    warnings: int = 0
    """All warnings of the run combined."""
    lives: list[tuple[float, int]] = field(default_factory=list)
    """Wall time of each reading, s, and number of scans since the first reading, from the cell's life counter."""

    @property
    def part(self) -> str:
        """Last reported place of the peg."""
        return PartPlace(self.report.part).name.lower()

    @property
    def scans(self) -> int:
        """Number of scans reported so far."""
        return self.lives[-1][1] if self.lives else 0

    def see(self, report: Report) -> None:
        """Add one report of the run."""
        step = (report.life - self.report.life) % 0x10000 if self.lives else 0
        self.report, self.warnings = report, self.warnings | report.warnings
        if report.result == Result.NONE:
            self.lives.append((time.monotonic(), step + self.scans))

    def scans_before(self, span: float) -> int:
        """Return the number of scans reported before the last `span`, s, of wall time.

        The result excludes at least the last block of samples, one second of the cell's clock, and is at least 0.
        """
        now = time.monotonic()
        told = max((scans for moment, scans in self.lives if moment <= now - span), default=0)
        return max(min(told, self.scans - BATCH), 0)


def tried(kind: FaultKind, stage: str, moment: float, arguments: Sequence[str], folder: Path) -> FaultCase:
    """Serve a cell, cause the fault `moment` seconds after `stage` begins; check the record and the return to production.

    Args:
        kind: A kind with `to_program`.
        stage: Name of the stage.
        moment: Time from the stage's first report to the fault, s.
        arguments: Further arguments of the served cell.
        folder: Folder of the records, which the cases of a campaign share.

    Raises:
        CellError: The cell does not start, or does not answer.
    """
    fast = ["--set", "sim.pace=max"]
    arguments = [*arguments, "--set", f"plc.life_timeout={PATIENCE:g}", *([] if kind.is_timed else fast)]
    tls = certificate(folder.parent) if kind.needs_tls else []
    before = _rows(folder)
    with served(folder, arguments, tls) as program, closing(Peer(*program.address, timeout=PATIENCE)) as peer:
        case, seen, kept = _broken(kind, stage, moment, program, peer)
        if not kind.ends_program:
            back = brought_back(peer)
            _wait_for_record(folder, seen.report.run)
    after, now = _rows(folder), seen.part
    if kind.ends_program:
        with served(folder, [*arguments, *fast]) as program, closing(Peer(*program.address, timeout=PATIENCE)) as peer:
            now = PartPlace(peer.look().part).name.lower()
            peer.connect()
            peer.take()
            back = brought_back(peer)
    is_kept = before.items() <= after.items() and seen.report.run not in before
    is_closed = all(row.outcome != RUNNING for row in after.values())
    case = _on_record(case, after.get(seen.report.run), folder, kept, seen)
    return replace(
        case,
        part_untrue=kind.ends_program and now not in LEFT[seen.part],
        record=case.record and is_kept and is_closed,
        reset=back[0],
        actions=back[1],
        following=back[2],
    )


def _broken(
    kind: FaultKind, stage: str, moment: float, program: ServedProgram, peer: Peer
) -> tuple[FaultCase, Seen, tuple[int, int]]:
    """Run an insertion with the fault; return the case, the readings, and the numbers of scans read up to the fault and up to
    `LAST` before it.
    """
    assert kind.to_program is not None
    seen, status, cycles = Seen(), None, list[float]()
    is_due = _lead_to(peer, stage, moment, seen)
    kept = seen.scans, seen.scans_before(LAST)
    with ThreadPoolExecutor(1) as pool:
        begin = pool.submit(kind.to_program, program)
        while not kind.ends_program and not begin.done():
            started = time.monotonic()
            seen.see(peer.cycle())
            cycles.append(time.monotonic() - started)
            time.sleep(CYCLE)
        end = begin.result()
    if end is not None:
        seen.see(peer.wait_for_result(LONGEST, seen.see))
        peer.acknowledge()
        if kind.name.startswith("disk"):
            _wait_for_warning(peer, seen)
        end()
    if kind.ends_program:
        with suppress(CellError):
            status = program.wait(ENDING)
    case = FaultCase(
        kind=kind.name,
        stage=stage,
        moment=moment,
        outcome=word(seen.report) if is_due else "not reached",
        state=State(seen.report.state).name,
        part=seen.part,
        record=status == kind.status,
        cycle=float(np.percentile(cycles, 99)) if cycles else math.nan,
    )
    return case, seen, kept


def _lead_to(peer: Peer, stage: str, moment: float, seen: Seen) -> bool:
    """Run an insertion until `moment`, s, after the stage's first report; return False if the insertion ends earlier.

    Raises:
        CellError: The cell refuses the insertion, does not answer or does not reach the stage.
    """
    number, entered, deadline = CATALOGUE.stage_number(stage), math.inf, time.monotonic() + LONGEST
    report = _started(peer)
    while time.monotonic() < deadline and not report.refusal:
        if report.run:
            seen.see(report)
        if report.result != Result.NONE:
            return False
        if report.stage == number:
            entered = min(entered, seen.scans)
        if seen.scans >= entered + moment * SCAN_RATE:
            return True
        time.sleep(CYCLE)
        report = peer.cycle()
    raise CellError(f"the insertion does not come to {stage}: {word(report)}")


def _started(peer: Peer) -> Report:
    """Start an insertion; if the cell refuses, reset it or act as the person at the cell, and try again."""
    peer.connect()
    peer.take()
    for _ in range(STARTS):
        peer.trigger(INSERT)
        if not (report := peer.wait_for_answer(PATIENCE)).refusal:
            break
        reset_if_needed(peer)
        peer.run(remedy(report), timeout=LONGEST)
    return report


def _wait_for_warning(peer: Peer, seen: Seen) -> None:
    """Read until the report has a warning about lost data, at most `WARNED`."""
    deadline = time.monotonic() + WARNED
    while not seen.warnings & Warnings.NOT_RECORDED and time.monotonic() < deadline:
        seen.warnings |= peer.cycle().warnings
        time.sleep(CYCLE)


def _wait_for_record(folder: Path, run: int) -> None:
    """Wait until the index contains the end of a run, at most `RECORDED`."""
    deadline = time.monotonic() + RECORDED
    while time.monotonic() < deadline and (
        (row := _rows(folder, is_read_only=True).get(run)) is None or row.outcome == RUNNING
    ):
        time.sleep(CYCLE)


def _rows(folder: Path, is_read_only: bool = False) -> dict[int, RunRow]:
    """Return all runs; unless `is_read_only`, close runs that are still open, as the program's next start does."""
    with Journal(folder, is_read_only=is_read_only) as journal:
        return {row.run: row for row in journal.runs(1_000_000)}


def _on_record(case: FaultCase, row: RunRow | None, folder: Path, kept: tuple[int, int], seen: Seen) -> FaultCase:
    """Judge the record of a run: its ending must be the PLC's or `LOST`, and only data of the last second may be missing.

    Args:
        case: The PLC's readings.
        row: Row of the run.
        folder: Folder of the journal.
        kept: Numbers of the run's scans that the PLC had read up to the fault, and up to `LAST` before it.
        seen: The readings of the run.
    """
    if row is None:
        return replace(case, record=False)
    told, least = kept
    stamps, forces, speeds = _samples(folder, row.run)
    moving = stamps[speeds > REST_SPEED]
    since = stamps[min(told, stamps.size - 1)] if stamps.size else math.nan
    is_ended = row.outcome in ("aborted", "fault")
    is_read = case.outcome not in ("none", "not reached")
    is_honest = row.outcome in (case.outcome, LOST) if is_read else row.outcome != RUNNING
    # A run killed in its first second can have no record except its row.
    is_whole = stamps.size >= max(least, row.outcome != LOST)
    is_warned = stamps.size >= seen.scans or bool(seen.warnings & Warnings.NOT_RECORDED)
    return replace(
        case,
        outcome=row.outcome if case.outcome == "none" else case.outcome,
        reason=row.reason,
        fault=row.fault,
        rest_after=max(float(moving[-1] - since), 0.0) if is_ended and moving.size else math.nan,
        peak_force=float(np.max(forces[told:], initial=0.0)),
        record=all((case.record, row.ended, is_honest, is_whole, is_warned or not case.kind.startswith("disk"))),
    )


def _samples(folder: Path, run: int) -> tuple[Vector, Vector, Vector]:
    """Return time, s, force, N, and largest joint velocity, rad/s, of each recorded scan of a run."""
    try:
        columns = read_samples(folder / f"run-{run:06d}.arrows")
    except CellError:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    forces = np.linalg.norm(np.column_stack([columns[f"force_{axis}"] for axis in "xyz"]), axis=1)
    speeds = np.max(np.abs(columns["velocities"]), axis=1) if columns["stamp"].size else np.zeros(0)
    return columns["stamp"], forces, speeds
