"""A disk that is full from a random moment of an insertion on: what the PLC is told, and what the journal says afterwards."""

import os
import resource
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

import numpy as np

from cell.journal import Journal
from cell.journal_schema import LOST, RunRow
from cell.lab.faults.kills import CYCLE, ENDING, LAST, Seen, insert, recorded
from cell.lab.faults.starts import Program, served
from drivers.errors import CellError
from plc_bridge.messages import Result
from plc_bridge.peer import Peer
from plc_bridge.registers import Warnings

WARNED = 3.0
"""Longest time from the end of a run to a warning about it, s of wall time."""
RECORDED = 300.0
"""Longest time until a run is on record once there is room again, s of wall time."""
WAYS = ("room again", "asked to end", "room again", "killed")
"""What comes after the insertion has ended on the full disk, one after the other."""


@dataclass(frozen=True, slots=True)
class FullDisk:
    """What one full disk leaves."""

    way: str
    """What came after the insertion had ended."""
    progress: int
    """Progress of the insertion at which no file grows any more, percent."""
    run: int
    result: str
    """How the PLC was told that it ended."""
    is_warned: bool
    """Whether the PLC was told, until a moment after the end, that the run is not recorded, where something of it was lost."""
    outcome: str
    """Outcome of that run after the next start; empty where it is not on record."""
    samples: int
    """Number of that run's scans on record."""
    told_scans: int
    """Number of that run's scans that the PLC had been told of a second before the disk was full."""
    still_running: int
    """Number of runs that are reported as under way after the next start."""
    changed: int
    """Number of earlier runs whose record is another one than before."""
    next_samples: int
    """Number of scans on record of a run that was made when there was room again; -1 where none was made."""

    @property
    def is_sound(self) -> bool:
        """Whether the run had an honest end, and nothing from before the last second is lost."""
        is_honest = self.outcome in ((self.result,) if self.way == "room again" else (self.result, LOST))
        is_whole = self.samples >= self.told_scans and self.changed == 0 and self.next_samples != 0
        return is_honest and is_whole and self.is_warned and self.still_running == 0


def fill(
    drawn: Sequence[tuple[str, int]],
    seed: int,
    arguments: Sequence[str],
    folder: Path,
    begun: Sequence[FullDisk],
    watch: Callable[[Sequence[FullDisk]], None],
) -> list[FullDisk]:
    """Serve the cell again and again on one journal, and let its disk be full from a drawn moment on.

    A program whose files may not grow meets the same as on a full disk, and nobody else on the computer does.

    Args:
        drawn: What comes after each full disk, and the progress at which it is full, percent.
        seed: Seed of the first simulated cell.
        arguments: Further arguments of the served cell.
        folder: Folder of the journal, with what an earlier call has left there.
        begun: First cases, which an earlier call has seen.
        watch: Called after each case with all of them.

    Raises:
        CellError: A cell cannot be started.
    """
    found = list(begun)
    with Journal(folder):
        pass  # a run that an earlier call broke off is closed
    for number in range(len(begun), len(drawn)):
        found.append(_one(folder, *drawn[number], [*arguments, "--set", f"sim.seed={seed + number}"]))
        watch(found)
    return found


def draw(tries: int, seed: int) -> list[tuple[str, int]]:
    """Return what comes after each full disk, one way after the other, and the progress at which it is full, percent."""
    rng = np.random.default_rng(seed)
    return [(WAYS[number % len(WAYS)], int(rng.integers(0, 101))) for number in range(tries)]


def begun(seen: Sequence[FullDisk], drawn: Sequence[tuple[str, int]]) -> list[FullDisk]:
    """Return the first cases that an earlier call has seen, as far as they are those that are drawn."""
    pairs = zip(seen, drawn, strict=False)
    return [case for case, _ in takewhile(lambda pair: (pair[0].way, pair[0].progress) == pair[1], pairs)]


def _one(folder: Path, way: str, progress: int, arguments: Sequence[str]) -> FullDisk:
    before, scans, after = _rows(folder), list[int](), 0
    with served(folder, arguments) as program:
        address = program.address

        def fill_up(seen: Seen) -> None:
            scans.append(seen.scans_before(LAST))
            _limit(program, 0)

        seen = insert(address, progress, fill_up)
        assert seen.report is not None
        is_warned = bool(seen.warnings & Warnings.NOT_RECORDED) or _is_warned(address)
        if way == "room again":
            _limit(program, resource.RLIM_INFINITY)
            _wait_for_record(folder, seen.run)
            after = insert(address, 101).run
        program.signal(signal.SIGKILL if way == "killed" else signal.SIGTERM)
        program.wait(ENDING)
    with Journal(folder):
        pass  # the next start closes what is open
    rows = _rows(folder)
    row = rows.get(seen.run)
    samples = recorded(folder, row)
    has_lost = samples < seen.lives[-1][1]
    return FullDisk(
        way=way,
        progress=progress,
        run=seen.run,
        result=Result(seen.report.result).name.lower(),
        is_warned=is_warned or not has_lost,
        outcome="" if row is None else row.outcome,
        samples=samples,
        told_scans=scans[0],
        still_running=sum(each.outcome == "running" for each in rows.values()),
        changed=sum(rows.get(run) != each for run, each in before.items()),
        next_samples=recorded(folder, rows.get(after)) if after else -1,
    )


def _is_warned(address: tuple[str, int]) -> bool:
    """Wait for a moment until a PLC is told that something is not recorded, and return whether it is."""
    deadline = time.monotonic() + WARNED
    with closing(Peer(*address)) as peer:
        while not (warned := bool(peer.look().warnings & Warnings.NOT_RECORDED)) and time.monotonic() < deadline:
            time.sleep(CYCLE)
    return warned


def _rows(folder: Path) -> dict[int, RunRow]:
    with Journal(folder, is_read_only=True) as journal:
        return {row.run: row for row in journal.runs(1_000_000)}


def _limit(program: Program, most: int) -> None:
    """Let no file of a program grow beyond so many bytes."""
    _, hard = resource.prlimit(program.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(program.pid, resource.RLIMIT_FSIZE, (most, hard))


def _wait_for_record(folder: Path, run: int) -> None:
    """Wait until the index has the end of a run.

    Raises:
        CellError: It does not come.
    """
    deadline = time.monotonic() + RECORDED
    while (row := _rows(folder).get(run)) is None or row.outcome == "running":
        if time.monotonic() > deadline:
            raise CellError(f"{os.fspath(folder)}: run {run} is not on record {RECORDED:g} s after there is room again")
        time.sleep(CYCLE)
