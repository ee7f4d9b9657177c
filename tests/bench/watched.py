"""Insertions of a served cell with two pages open: times of its scans, and growth of its memory, threads and files.

    python -m tests.bench.watched HOURS

The pages are two connections that read all that an open page gets; what a tablet draws is not this computer's work.
"""

import asyncio
import os
import sys
import threading
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from tornado.websocket import websocket_connect

from cell.lab.faults.cases import INSERT, LONGEST
from cell.records.samples import read_samples
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import Result
from tests.serving import process

PAGES = 2
SETTLED = 0.25
"""Share of the runs after which caches are filled and growth is measured."""
DAY = 24.0


@dataclass(frozen=True)
class WatchedRun:
    """One insertion of the served cell."""

    hours: float
    """Wall time since the first run, hours."""
    run: int
    grown: tuple[float, int, int]
    """Memory, MB, and number of threads and of open files of the cell's process after the run."""


@contextmanager
def open_pages(address: tuple[str, int]) -> Iterator[None]:
    """Keep pages open that read everything they are sent; they begin with what is sent to a page that opens."""
    are_open, is_over = threading.Event(), threading.Event()

    async def watch() -> None:
        pages = [await websocket_connect(f"ws://{address[0]}:{address[1]}/live") for _ in range(PAGES)]
        while not is_over.is_set():
            await asyncio.gather(*(page.read_message() for page in pages))
            are_open.set()
        for page in pages:
            page.close()
            while await page.read_message() is not None:
                pass

    watcher = threading.Thread(target=lambda: asyncio.run(watch()))
    watcher.start()
    try:
        if not are_open.wait(LONGEST):
            raise TimeoutError("no page has opened")
        yield
    finally:
        is_over.set()
        watcher.join()


def watched(folder: Path, in_turns: bool) -> Generator[WatchedRun, None, None]:
    """Yield insertions of one cell without end; the first only fills its caches.

    Args:
        folder: Folder of its records.
        in_turns: True to open the pages in every second run alone, first without; False to keep them open.
    """
    with (
        process(folder, (), "--page", "127.0.0.1:0", lines=2) as (running, [modbus, page]),
        closing(Peer(*modbus)) as peer,
        nullcontext() if in_turns else open_pages(page),
    ):
        peer.connect()
        peer.take()
        peer.run(INSERT, timeout=LONGEST)
        began, number = time.monotonic(), 0
        while True:
            with open_pages(page) if in_turns and number % 2 else nullcontext():
                report = peer.run(INSERT, timeout=LONGEST)
            if report.result not in (Result.SUCCESS, Result.FAILURE):
                raise RuntimeError(f"run {report.run}: {Result(report.result).name}, fault {report.fault}")
            yield WatchedRun((time.monotonic() - began) / 3600.0, report.run, _grown(running.pid))
            number += 1


def p99(folder: Path, runs: Sequence[WatchedRun]) -> float:
    """Return the 99th percentile of the time from one recorded scan of these runs to the next, s."""
    stamps = [read_samples(folder / f"run-{run.run:06d}.arrows")["stamp"] for run in runs]
    return float(np.percentile(np.concatenate([np.diff(each) for each in stamps]), 99))


def _grown(pid: int) -> tuple[float, int, int]:
    at = Path(f"/proc/{pid}")
    pages = int((at / "statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / 1e6, len(list((at / "task").iterdir())), len(list((at / "fd").iterdir()))


def main() -> None:
    """Serve for some hours and print what grew."""
    hours, runs = float(sys.argv[1]), list[WatchedRun]()
    with TemporaryDirectory() as folder, closing(watched(Path(folder), in_turns=False)) as watching:
        for run in watching:
            runs.append(run)
            if run.hours >= hours:
                break
        interval = 1e3 * p99(Path(folder), runs)
    kept = runs[int(SETTLED * len(runs)) :]
    slopes = np.polyfit([run.hours for run in kept], [run.grown for run in kept], 1)[0] * DAY
    console = Console(soft_wrap=True)
    console.print(
        f"{runs[-1].hours:.2f} h, {len(runs)} insertions, {PAGES} pages; p99 of the scan's interval {interval:.1f} ms"
    )
    course = [f"{run.grown[0]:.1f}" for run in runs[:: max(len(runs) // 8, 1)]]
    console.print(f"memory in equal steps, MB: {', '.join(course)}")
    console.print(f"growth in a day: {slopes[0]:+.1f} MB, {slopes[1]:+.1f} threads, {slopes[2]:+.1f} files")


if __name__ == "__main__":
    main()
