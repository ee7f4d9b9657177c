"""The cost of open pages for the scan: its intervals with two pages and with none, in pairs, while a real-time cell works."""

import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cell.assembly import assemble, opened
from cell.config import load
from cell.journal import Journal
from cell.line import PARAMETERS, PROGRAMS
from cell.live import Live, Look
from cell.page.server import THREAD, PageServer
from cell.part_state import UNRESOLVED
from cell.states import State
from cell.supervisor import Supervisor
from plc_bridge.bridge import Bridge
from plc_bridge.images import CommandImage
from plc_bridge.messages import FIRST_PROGRAM, Control, PartPlace

PAGES = 2
USER = "study"


@dataclass(frozen=True, slots=True)
class Pair:
    """Jitter of the scan, which is how far an interval between two scans is from its period, s: the 99th percentile."""

    without: float
    with_pages: float
    scans: int
    """Number of scans of both stretches together."""
    share: float = 0.0
    """Processor time of the page's thread with the pages open, part of one core: all that it can take from the scan."""

    @property
    def ratio(self) -> float:
        """Return the jitter with pages over that without."""
        return self.with_pages / self.without


class TimedLive(Live):
    """A slot that notes when the scan came by."""

    def __init__(self) -> None:
        super().__init__()
        self.stamps: list[float] = []

    def show(self, look: Look) -> None:
        """Put in one look."""
        self.stamps.append(time.perf_counter())
        super().show(look)


def measure(pairs: int, length: float, folder: Path, done: Callable[[], None]) -> list[Pair]:
    """Serve a simulated cell in real time, run after run, and return what each pair of stretches shows.

    Every other pair begins with the pages open, so that what changes slowly on the computer meets both alike. The
    pages are read by another process, as by browsers on other computers.

    Args:
        pairs: Number of pairs.
        length: Time of one stretch, s.
        folder: Folder of the records.
        done: Called after each pair.
    """
    found = []
    with _serving(folder) as (server, live, period):
        for number in range(pairs):
            stretches, used = {}, {}
            for has_pages in (bool(number % 2), not number % 2):
                before = _thread_time()
                stretches[has_pages] = _stretch(server, live, period, length, has_pages)
                used[has_pages] = _thread_time() - before
            without, with_pages = stretches[False], stretches[True]
            scans = len(without) + len(with_pages)
            found.append(Pair(_p99(without), _p99(with_pages), scans, used[True] / length))
            done()
    return found


def _thread_time() -> float:
    """Return the processor time of the page's thread so far, s."""
    thread = next(thread for thread in threading.enumerate() if thread.name == THREAD)
    return int(Path(f"/proc/self/task/{thread.native_id}/schedstat").read_text().split()[0]) / 1e9


def _p99(jitter: list[float]) -> float:
    return float(np.percentile(jitter, 99)) if jitter else math.nan


def _stretch(server: PageServer, live: TimedLive, period: float, length: float, has_pages: bool) -> list[float]:
    with watched(server, PAGES if has_pages else 0):
        live.stamps.clear()
        threading.Event().wait(length)
        stamps = list(live.stamps)
    # Between two runs the scan also opens and closes records; such an interval belongs to no scan.
    return [abs(gap - period) for gap in np.diff(stamps).tolist() if gap < 10 * period]


@contextmanager
def watched(server: PageServer, pages: int) -> Iterator[None]:
    """Keep pages open in another process meanwhile."""
    if pages == 0:
        yield
        return
    host, port = server.address
    command = [sys.executable, "-m", "cell.lab.page.watcher", f"ws://{host}:{port}/live", str(pages)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()  # all are open
        try:
            yield
        finally:
            process.terminate()


@contextmanager
def _serving(folder: Path) -> Iterator[tuple[PageServer, TimedLive, float]]:
    """Yield the page of a cell that inserts one peg after the other in real time."""
    loaded = load(sets=["sim.pace=1.0", "plc.modbus.port=0"])
    bridge, live, is_over = Bridge(loaded.cell.plc, PROGRAMS, PARAMETERS), TimedLive(), threading.Event()
    server = PageServer(("127.0.0.1", 0), bridge, live, loaded, folder)

    def serve() -> None:
        with Journal(folder) as journal, opened(assemble(loaded.cell)) as cell:
            Supervisor(cell, loaded, bridge, journal, is_over, live).serve()

    def start_again() -> None:
        while not is_over.wait(0.2):
            report = bridge.report_for(USER)
            if report.state == State.ABORTED:  # a computer too busy for the scan ends a run with a fault
                bridge.submit(USER, CommandImage(code=Control.RESET))
            elif PartPlace(report.part) in UNRESOLVED and report.state in (State.IDLE, State.COMPLETE):
                bridge.submit(USER, CommandImage(code=Control.CLEARED))
            elif report.state in (State.IDLE, State.COMPLETE):
                bridge.submit(USER, CommandImage(code=FIRST_PROGRAM))

    bridge.take(USER)
    threads = [threading.Thread(target=work) for work in (serve, start_again)]
    server.start()
    for thread in threads:
        thread.start()
    try:
        while not live.stamps:
            is_over.wait(0.1)
        yield server, live, 1.0 / loaded.cell.scan_rate
    finally:
        is_over.set()
        for thread in threads:
            thread.join()
        server.close()
