"""The program killed, or asked to end, during insertions: its journal and its next start."""

import signal
import time
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from itertools import takewhile
from pathlib import Path

import numpy as np

from cell.lab.faults.starts import served
from cell.records.journal import Journal
from cell.records.sample_blocks import BATCH
from cell.records.samples import read_samples
from cell.records.schema import LOST, RunRow
from cell.run.states import State
from drivers.errors import CellError
from plc_bridge.messages import Control, PartPlace, Report, Result
from plc_bridge.peer import Peer
from skills.catalogue import CATALOGUE

LONGEST = 1800.0
"""Longest time until an insertion reaches its progress, s of wall time; other work can leave this one little time."""
CYCLE = 0.02
"""Time between two cycles of the PLC, s of wall time."""
ENDS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGKILL, signal.SIGKILL, signal.SIGHUP)
"""Signals, in turn."""
LAST = 1.0
"""Time before a signal from which samples can be lost, s of wall time."""
ENDING = 30.0
"""Longest wait for the end of a program after a request, s of wall time."""
RESETS, PAUSE = 5, 1.0
"""Number of resets of an aborted cell before it is given up, and the time before each, s of wall time."""
LEFT = {
    "rack": ("rack", "unknown"),
    "in_hand": ("unknown",),
    "in_hole": ("in_hole", "unknown"),
    "seated": ("rack", "unknown"),
    "bin": ("bin", "rack", "unknown"),
    "on_plate": ("on_plate",),
    "unknown": ("unknown",),
}
"""Positions that the next start can report, by the last reported position. A peg can move on in the moment before the
end, and a held peg has no known position after the hand is empty."""
_INSERT = CATALOGUE["insert_peg"].code


@dataclass(frozen=True, slots=True)
class Kill:
    """Result of one signal."""

    signal: str
    progress: int
    """Progress of an insertion at the signal, percent; 100 is after its end."""
    status: int
    """Exit status of the program; negative is the signal that killed it."""
    told: int
    """Number of the run in the PLC's last reading."""
    outcome: str
    """Outcome of that run after the next start; empty if it has no record."""
    samples: int
    """Number of that run's scans on record."""
    told_scans: int
    """Number of that run's scans that the PLC had read a second before the signal."""
    still_running: int
    """Number of runs reported as running after the next start."""
    twice: int
    """Number of runs with the number of an earlier run."""
    part: str
    """Position of the peg in the PLC's last reading."""
    part_next: str
    """Position of the peg in the report of the next start, in a world with empty hand and hole."""
    resets: int = 0
    """Number of resets that the cell needed before its insertion began."""
    aborted: int = 0
    """Fault code of the aborted cell before its insertion began; 0 if it was ready."""
    trouble: str = ""
    """Reason why the insertion did not reach its progress; empty if it did."""

    @property
    def is_sound(self) -> bool:
        """True if only data of the last second were lost, and every report was true."""
        is_ended_well = self.status == (-signal.SIGKILL if self.signal == "SIGKILL" else 0)
        is_told = self.told == 0 or self.outcome not in ("", "running")
        is_told = is_told and self.samples >= self.told_scans
        is_part_kept = self.part_next in LEFT[self.part]
        is_clean = self.still_running == 0 and self.twice == 0 and not self.trouble
        return is_ended_well and is_told and is_part_kept and is_clean


def kill(
    drawn: Sequence[tuple[signal.Signals, int]],
    seed: int,
    arguments: Sequence[str],
    folder: Path,
    begun: Sequence[Kill],
    watch: Callable[[Sequence[Kill]], None],
) -> list[Kill]:
    """Start the served cell repeatedly on one journal, and end it at drawn moments.

    Args:
        drawn: Signal of each end, and the progress at the signal, percent.
        seed: Seed of the first simulated cell.
        arguments: Further arguments of the served cell.
        folder: Folder of the journal, with the results of an earlier call.
        begun: First ends, from an earlier call.
        watch: Called after each end with all of them.

    Raises:
        CellError: A cell does not start.
    """
    found = list(begun)
    for number in range(len(begun), len(drawn)):
        part_now, case = _one(folder, *drawn[number], [*arguments, "--set", f"sim.seed={seed + number}"])
        if number > len(begun):
            found[-1] = replace(found[-1], part_next=part_now)
        found.append(case)
        watch(found)
    if len(found) > len(begun):
        with served(folder, arguments) as program:
            found[-1] = replace(found[-1], part_next=part_at(program.address))
        watch(found)
    return found


def draw(tries: int, seed: int, ends: Sequence[signal.Signals] = ENDS) -> list[tuple[signal.Signals, int]]:
    """Return the signal of each end, from `ends` in turn, and the progress at the signal, percent."""
    rng = np.random.default_rng(seed)
    return [(ends[number % len(ends)], int(rng.integers(0, 101))) for number in range(tries)]


def begun(seen: Sequence[Kill], drawn: Sequence[tuple[signal.Signals, int]]) -> list[Kill]:
    """Return the first complete ends of an earlier call, as far as they match the drawn ones."""
    pairs = zip(seen, drawn, strict=False)
    return [case for case, _ in takewhile(lambda pair: pair[0].part_next and _was(pair[0]) == pair[1], pairs)]


def _was(case: Kill) -> tuple[signal.Signals, int]:
    return signal.Signals[case.signal], case.progress


def _one(folder: Path, how: signal.Signals, progress: int, arguments: Sequence[str]) -> tuple[str, Kill]:
    """Return the peg's position at the start of the cell, and the result of the signal without the next start's report."""
    with Journal(folder, is_read_only=True) as journal:
        before = {row.run for row in journal.runs(1_000_000)}
    seen, trouble = Seen(), ""
    with served(folder, arguments) as program:
        part_now = part_at(program.address)
        try:
            insert(program.address, progress, seen=seen)
        except CellError as error:
            trouble = str(error)
        program.signal(how)
        try:
            status = program.wait(ENDING)
        except CellError as error:
            status, trouble = -signal.SIGKILL, str(error)  # which it receives at once
    with Journal(folder) as journal:
        rows = {row.run: row for row in journal.runs(1_000_000)}
    told = seen.run
    row = rows.get(told)
    return part_now, Kill(
        signal=how.name,
        progress=progress,
        status=status,
        told=told,
        outcome="" if row is None else row.outcome,
        samples=recorded(folder, row),
        told_scans=seen.scans_before(LAST),
        still_running=sum(each.outcome == "running" for each in rows.values()),
        twice=int(told in before),
        part=seen.part.name.lower(),
        part_next="",
        resets=seen.resets,
        aborted=seen.aborted,
        trouble=trouble,
    )


def part_at(address: tuple[str, int]) -> str:
    """Return the peg's position reported by a served cell."""
    with closing(Peer(*address)) as peer:
        return PartPlace(peer.look().part).name.lower()


def recorded(folder: Path, row: RunRow | None) -> int:
    """Return the number of recorded scans of a run."""
    if row is None or row.outcome != LOST:
        return 0 if row is None else row.samples
    with suppress(CellError):
        return int(read_samples(folder / f"run-{row.run:06d}.arrows")["stamp"].size)
    return 0


@dataclass(slots=True)
class Seen:
    """A PLC's readings of a run."""

    run: int = 0
    part: PartPlace = PartPlace.UNKNOWN
    warnings: int = 0
    """All warnings of the run combined."""
    resets: int = 0
    """Number of resets before the run began."""
    aborted: int = 0
    """Fault code of the aborted cell before the first of them."""
    report: Report | None = None
    """The last report."""
    lives: list[tuple[float, int]] = field(default_factory=list)
    """Wall times, and the number of scans since the first of them, from the cell's sign of life."""

    def see(self, report: Report) -> None:
        """Add one report of the run."""
        step = 0 if self.report is None or report.run != self.run else (report.life - self.report.life) % 0x10000
        if report.run != self.run:
            self.lives, self.warnings = [], 0
        self.run, self.part, self.report = report.run, PartPlace(report.part), report
        self.warnings |= report.warnings
        if report.result == Result.NONE:
            self.lives.append((time.monotonic(), step + (self.lives[-1][1] if self.lives else 0)))

    def scans_before(self, span: float) -> int:
        """Return the number of scans reported before the last `span`, s, of wall time.

        If it is earlier, the limit is a block of samples: one second of the cell's clock.
        """
        now = time.monotonic()
        told = max((scans for moment, scans in self.lives if moment <= now - span), default=0)
        return max(min(told, self.lives[-1][1] - BATCH), 0) if self.lives else 0


def insert(
    address: tuple[str, int], progress: int, then: Callable[[Seen], None] | None = None, seen: Seen | None = None
) -> Seen:
    """Run an insertion to this progress, percent, and return its last report.

    Obstacles to its start are removed first, as by a person: an aborted cell is reset, and a peg left by an earlier end
    is removed.

    Args:
        address: Address of the served cell.
        progress: Progress to reach, percent; 101 is its end.
        then: Called at that progress; the insertion then continues to its end. None returns at that progress.
        seen: Destination of the reports; also the return value.

    Raises:
        CellError: The insertion does not reach that progress.
    """
    deadline, seen = time.monotonic() + LONGEST, seen or Seen()
    with closing(Peer(*address)) as peer:
        before = peer.connect().run
        peer.take()
        report = peer.trigger(_INSERT)
        while time.monotonic() < deadline:
            if report.run not in (0, before):
                seen.see(report)
                # An end that this PLC never reads is valid too: the cell regarded the PLC as lost, for example on a
                # busy computer.
                is_over = report.result != Result.NONE or report.state == State.ABORTED
                if then is not None and (is_over or report.progress >= progress):
                    then(seen)
                    then, progress = None, 101
                if is_over or report.progress >= progress:
                    return seen
            elif report.state in (State.ABORTED, State.STOPPED):
                _reset(peer, report, seen)
                report = peer.trigger(_INSERT)
            elif report.refusal:
                peer.run(Control.CLEARED, timeout=LONGEST)
                report = peer.trigger(_INSERT)
            time.sleep(CYCLE)
            report = peer.cycle()
    told = f"state {report.state}, refusal {report.refusal}, result {report.result}"
    raise CellError(f"the insertion does not come to {progress} % in {LONGEST:g} s: {told}")


def _reset(peer: Peer, report: Report, seen: Seen) -> None:
    """Reset an aborted or stopped cell, and record the reset.

    Raises:
        CellError: The cell stays aborted after repeated resets.
    """
    if seen.resets >= RESETS:
        raise CellError(f"the cell stands aborted with fault {report.fault} after {seen.resets} resets")
    seen.aborted = seen.aborted or report.fault
    seen.resets += 1
    peer.take()
    deadline = time.monotonic() + PAUSE
    while time.monotonic() < deadline:
        time.sleep(CYCLE)
        peer.cycle()
    peer.run(Control.RESET, timeout=LONGEST)
