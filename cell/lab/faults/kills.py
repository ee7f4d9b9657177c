"""The program killed, or asked to end, in the middle of insertions: what its journal and its next start say."""

import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cell.journal import Journal
from cell.journal_schema import LOST
from cell.samples import read_samples
from drivers.errors import CellError
from plc_bridge.messages import Control, PartPlace, Result
from plc_bridge.peer import Peer
from skills.catalogue import CATALOGUE

LONGEST = 300.0
"""Longest time until an insertion has come so far, s of wall time."""
CYCLE = 0.02
"""Time between two cycles of the PLC, s of wall time."""
ENDS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGKILL, signal.SIGKILL, signal.SIGHUP)
"""Signals, one after the other."""
ENDING = 30.0
"""Longest wait for a program that was asked to end, s of wall time."""
LEFT = {
    "rack": ("rack", "unknown"),
    "in_hand": ("unknown",),
    "in_hole": ("in_hole", "unknown"),
    "seated": ("rack", "unknown"),
    "bin": ("bin", "rack", "unknown"),
    "on_plate": ("on_plate",),
    "unknown": ("unknown",),
}
"""Places that the next start may tell by the place that was told last: a peg may have gone on for the moment until the end, and of one
that was held nobody knows once the hand is empty.
"""
_INSERT = CATALOGUE["insert_peg"].code


@dataclass(frozen=True, slots=True)
class Kill:
    """What one signal leaves."""

    signal: str
    progress: int
    """Progress of an insertion at which the signal comes, percent; 100 is after its end."""
    status: int
    """Exit status of the program; negative is the signal that killed it."""
    told: int
    """Number of the run that the PLC had read last."""
    outcome: str
    """Outcome of that run after the next start; empty where it is not on record."""
    samples: int
    """Number of that run's scans on record."""
    still_running: int
    """Number of runs that are reported as under way after the next start."""
    twice: int
    """Number of runs whose number an earlier one had."""
    part: str
    """Place of the peg as the PLC had read it last."""
    part_next: str
    """Place of the peg as the next start tells it, of a world whose hand and hole are empty."""

    @property
    def is_sound(self) -> bool:
        """Whether nothing was lost but the last second, and nothing is said that is not true."""
        is_ended_well = self.status == (-signal.SIGKILL if self.signal == "SIGKILL" else 0)
        is_told = self.told == 0 or self.outcome not in ("", "running")
        is_part_kept = self.part_next in LEFT[self.part]
        return is_ended_well and is_told and is_part_kept and self.still_running == 0 and self.twice == 0


def kill(tries: int, seed: int, arguments: Sequence[str], watch: Callable[[Kill], None]) -> list[Kill]:
    """Start the served cell again and again on one journal, and end it at random moments; every third time politely.

    Raises:
        CellError: A cell cannot be started.
    """
    rng, found = np.random.default_rng(seed), list[Kill]()
    with tempfile.TemporaryDirectory() as folder:
        for number in range(tries):
            how = ENDS[number % len(ENDS)]
            drawn = [*arguments, "--set", f"sim.seed={seed + number}"]
            part_now, case = _one(Path(folder), how, int(rng.integers(0, 101)), drawn)
            found[-1:] = [replace(last, part_next=part_now) for last in found[-1:]]
            found.append(case)
            watch(case)
        with _served(Path(folder), arguments) as (_, address):
            found[-1:] = [replace(last, part_next=_part_at(address)) for last in found[-1:]]
    return found


def _one(folder: Path, how: signal.Signals, progress: int, arguments: Sequence[str]) -> tuple[str, Kill]:
    """Return where the peg is when the cell starts, and what the signal leaves, without what the next start will say."""
    with Journal(folder, is_read_only=True) as journal:
        before = {row.run for row in journal.runs(1_000_000)}
    with _served(folder, arguments) as (process, address):
        part_now = _part_at(address)
        told, part = _insert(address, progress)
        process.send_signal(how)
        status = process.wait(ENDING)
    with Journal(folder) as journal:
        rows = {row.run: row for row in journal.runs(1_000_000)}
    row = rows.get(told)
    samples = 0
    if row is not None and row.outcome == LOST:
        with suppress(CellError):
            samples = int(read_samples(folder / f"run-{told:06d}.arrows")["stamp"].size)
    return part_now, Kill(
        signal=how.name,
        progress=progress,
        status=status,
        told=told,
        outcome="" if row is None else row.outcome,
        samples=row.samples if row is not None and row.outcome != LOST else samples,
        still_running=sum(each.outcome == "running" for each in rows.values()),
        twice=int(told in before),
        part=part.name.lower(),
        part_next="",
    )


@contextmanager
def _served(folder: Path, arguments: Sequence[str]) -> Iterator[tuple["subprocess.Popen[str]", tuple[str, int]]]:
    """Yield a served cell in a process of its own, and where it listens."""
    command = [
        sys.executable,
        "-m",
        "cell",
        "serve",
        "--journal",
        str(folder),
        "--set",
        "plc.modbus.port=0",
        *arguments,
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            assert process.stdout is not None
            words = process.stdout.readline().split()
            if not words:
                raise CellError(f"the cell does not start: {' '.join(command)}")
            host, port = words[-1].rsplit(":", 1)
            yield process, (host, int(port))
        finally:
            process.kill()


def _part_at(address: tuple[str, int]) -> str:
    """Return where a served cell says that its peg is."""
    with closing(Peer(*address)) as peer:
        return PartPlace(peer.look().part).name.lower()


def _insert(address: tuple[str, int], progress: int) -> tuple[int, PartPlace]:
    """Let an insertion come so far, percent, and return the number of the run and the place of the peg that were told last.

    Raises:
        CellError: It does not come so far.
    """
    deadline = time.monotonic() + LONGEST
    with closing(Peer(*address)) as peer:
        peer.connect()
        peer.take()
        code, report = int(_INSERT), peer.trigger(_INSERT)
        while True:
            if report.refusal or (code == Control.CLEARED and report.result != Result.NONE):
                # A peg that an earlier end left somewhere is taken away first.
                code = Control.CLEARED if report.refusal else _INSERT
                peer.acknowledge()
                report = peer.trigger(code)
            elif code == _INSERT and (report.result != Result.NONE or (report.run and report.progress >= progress)):
                return report.run, PartPlace(report.part)
            elif time.monotonic() > deadline:
                raise CellError(f"the insertion does not come to {progress} % in {LONGEST:g} s")
            time.sleep(CYCLE)
            report = peer.cycle()
