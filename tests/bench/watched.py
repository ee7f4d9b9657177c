"""Insertions of a served cell with two pages open, and growth of its memory, threads and files.

    python -m tests.bench.watched HOURS

The pages are two connections that read all that an open page gets; what a tablet draws is not this computer's work.
"""

import asyncio
import os
import sys
import threading
import time
from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from tornado.websocket import websocket_connect

from cell.lab.faults.cases import INSERT, LONGEST
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


def watched(folder: Path) -> Generator[WatchedRun, None, None]:
    """Yield insertions of one cell without end; the first only fills its caches. `folder` is that of its records."""
    with (
        process(folder, (), "--page", "127.0.0.1:0", lines=2) as (running, [modbus, page]),
        closing(Peer(*modbus)) as peer,
        open_pages(page),
    ):
        peer.connect()
        peer.take()
        peer.run(INSERT, timeout=LONGEST)
        began = time.monotonic()
        while True:
            report = peer.run(INSERT, timeout=LONGEST)
            if report.result not in (Result.SUCCESS, Result.FAILURE):
                raise RuntimeError(f"run {report.run}: {Result(report.result).name}, fault {report.fault}")
            yield WatchedRun((time.monotonic() - began) / 3600.0, _grown(running.pid))


def _grown(pid: int) -> tuple[float, int, int]:
    at = Path(f"/proc/{pid}")
    pages = int((at / "statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / 1e6, len(list((at / "task").iterdir())), len(list((at / "fd").iterdir()))


def main() -> None:
    """Serve for some hours and print what grew."""
    hours, runs = float(sys.argv[1]), list[WatchedRun]()
    with TemporaryDirectory() as folder, closing(watched(Path(folder))) as watching:
        for run in watching:
            runs.append(run)
            if run.hours >= hours:
                break
    kept = runs[int(SETTLED * len(runs)) :]
    slopes = np.polyfit([run.hours for run in kept], [run.grown for run in kept], 1)[0] * DAY
    console = Console(soft_wrap=True)
    console.print(f"{runs[-1].hours:.2f} h, {len(runs)} insertions, {PAGES} pages")
    course = [f"{run.grown[0]:.1f}" for run in runs[:: max(len(runs) // 8, 1)]]
    console.print(f"memory in equal steps, MB: {', '.join(course)}")
    console.print(f"growth in a day: {slopes[0]:+.1f} MB, {slopes[1]:+.1f} threads, {slopes[2]:+.1f} files")


if __name__ == "__main__":
    main()
