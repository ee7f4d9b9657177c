"""A disk that becomes full at a random moment of an insertion: the PLC's readings, and the journal afterwards."""

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

from cell.lab.faults.kills import CYCLE, ENDING, LAST, Seen, insert, recorded
from cell.lab.faults.starts import Program, served
from cell.records.journal import Journal
from cell.records.schema import LOST, RunRow
from drivers.errors import CellError
from plc_bridge.messages import Result
from plc_bridge.peer import Peer
from plc_bridge.registers import Warnings

WARNED = 3.0
"""Longest time from the end of a run to its warning, s of wall time."""
RECORDED = 300.0
"""Longest time until a run is recorded after the disk has space again, s of wall time."""
WAYS = ("room again", "asked to end", "room again", "killed")
"""Events after the insertion has ended on the full disk, one after the other."""


@dataclass(frozen=True, slots=True)
class FullDisk:
    """Result of one full disk."""

    way: str
    """Event after the insertion had ended."""
    progress: int
    """Progress of the insertion from which files cannot grow, percent."""
    run: int
    result: str
    """Ending that the PLC read."""
    is_warned: bool
    """True if the PLC read a warning about lost data within a moment after the end; also True if nothing was lost."""
    outcome: str
    """Outcome of that run after the next start; empty if it has no record."""
    samples: int
    """Number of that run's scans on record."""
    told_scans: int
    """Number of that run's scans that the PLC had read a second before the disk was full."""
    still_running: int
    """Number of runs reported as running after the next start."""
    changed: int
    """Number of earlier runs with a changed record."""
    next_samples: int
    """Number of recorded scans of a run made after the disk had space again; -1 if none was made."""

    @property
    def is_sound(self) -> bool:
        """True if the run had a correct ending, and lost only data of its last second."""
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
    """Serve the cell repeatedly on one journal, with a disk that becomes full at a drawn moment.

    A limit on file sizes has the same effect on this program as a full disk, without affecting the rest of the
    computer.

    Args:
        drawn: Event after each full disk, and the progress at which the disk is full, percent.
        seed: Seed of the first simulated cell.
        arguments: Further arguments of the served cell.
        folder: Folder of the journal, with the results of an earlier call.
        begun: First cases, from an earlier call.
        watch: Called after each case with all of them.

    Raises:
        CellError: A cell does not start.
    """
    found = list(begun)
    with Journal(folder):
        pass  # a run that an earlier call interrupted is closed
    for number in range(len(begun), len(drawn)):
        found.append(_one(folder, *drawn[number], [*arguments, "--set", f"sim.seed={seed + number}"]))
        watch(found)
    return found


def draw(tries: int, seed: int) -> list[tuple[str, int]]:
    """Return the event after each full disk, in turn, and the progress at which the disk is full, percent."""
    rng = np.random.default_rng(seed)
    return [(WAYS[number % len(WAYS)], int(rng.integers(0, 101))) for number in range(tries)]


def begun(seen: Sequence[FullDisk], drawn: Sequence[tuple[str, int]]) -> list[FullDisk]:
    """Return the first cases of an earlier call, as far as they match the drawn ones."""
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
        pass  # the next start closes open runs
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
    """Wait a moment for a warning about unrecorded data, and return True if the PLC reads one."""
    deadline = time.monotonic() + WARNED
    with closing(Peer(*address)) as peer:
        while not (warned := bool(peer.look().warnings & Warnings.NOT_RECORDED)) and time.monotonic() < deadline:
            time.sleep(CYCLE)
    return warned


def _rows(folder: Path) -> dict[int, RunRow]:
    with Journal(folder, is_read_only=True) as journal:
        return {row.run: row for row in journal.runs(1_000_000)}


def _limit(program: Program, most: int) -> None:
    """Limit the files of a program to this number of bytes."""
    _, hard = resource.prlimit(program.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(program.pid, resource.RLIMIT_FSIZE, (most, hard))


def _wait_for_record(folder: Path, run: int) -> None:
    """Wait until the index contains the end of a run.

    Raises:
        CellError: The end does not appear.
    """
    deadline = time.monotonic() + RECORDED
    while (row := _rows(folder).get(run)) is None or row.outcome == "running":
        if time.monotonic() > deadline:
            raise CellError(f"{os.fspath(folder)}: run {run} is not on record {RECORDED:g} s after there is room again")
        time.sleep(CYCLE)
