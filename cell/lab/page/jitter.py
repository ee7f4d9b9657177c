"""Cost of open pages for the scan: intervals with two pages and with none, in pairs, while a real-time cell works."""

import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cell.config.load import load
from cell.config.parameters import PARAMETERS
from cell.devices.assembly import assemble, opened
from cell.page.front import THREAD
from cell.page.server import PageServer
from cell.peg.part_state import UNRESOLVED
from cell.records.journal import Journal
from cell.run.line import PROGRAMS
from cell.run.live import Live, Look
from cell.run.states import State
from cell.run.supervisor import Supervisor
from plc_bridge.bridge import Bridge
from plc_bridge.images import CommandImage
from plc_bridge.messages import FIRST_PROGRAM, Control, PartPlace

PAGES = 2
TURNS = (False, True, True, False, True, False, False, True)
"""Order within a pair, True for open pages: neither a linear nor a quadratic drift favours one side. Every other pair
is reversed."""
RESAMPLES = 1000
"""Number of resamplings of the pairs for the interval."""
USER = "study"


@dataclass(frozen=True, slots=True)
class Pair:
    """Jitter of the scan with pages and without, in alternating intervals."""

    without: Sequence[float]
    """Deviation of each interval between two scans from its period, s."""
    with_pages: Sequence[float]
    share: float = 0.0
    """Processor time of the page's thread with the pages open, fraction of one core: an upper bound of its cost for the
    scan."""

    @property
    def p99(self) -> tuple[float, float]:
        """Return the 99th percentile without pages and with them, s."""
        return _p99(self.without), _p99(self.with_pages)

    @property
    def ratio(self) -> float:
        """Return the ratio of the jitter with pages to that without."""
        without, with_pages = self.p99
        return with_pages / without

    def told(self) -> dict[str, float]:
        """Return the figures of the pair as data."""
        without, with_pages = self.p99
        scans = len(self.without) + len(self.with_pages)
        told = {"without": without, "with_pages": with_pages, "ratio": self.ratio, "scans": scans, "share": self.share}
        return {name: float(value) for name, value in told.items()}


@dataclass(frozen=True, slots=True)
class Cost:
    """Cost of open pages for the scan: the ratio of the 99th percentiles of all scans, and its interval."""

    ratio: float
    low: float
    high: float
    """Upper end of the 95 % interval after the lower end `low`, from resampled pairs; scans of one pair are resampled together because they are
    correlated."""


def cost(pairs: Sequence[Pair]) -> Cost:
    """Return the cost of open pages for the scan."""
    rng = np.random.default_rng(0)
    drawn = [rng.integers(len(pairs), size=len(pairs)) for _ in range(RESAMPLES)]
    ratios = [_ratio([pairs[number] for number in numbers]) for numbers in drawn]
    low, high = np.percentile(ratios, (2.5, 97.5)).tolist()
    return Cost(_ratio(pairs), low, high)


def _ratio(pairs: Sequence[Pair]) -> float:
    without = np.concatenate([pair.without for pair in pairs])
    return float(np.percentile(np.concatenate([pair.with_pages for pair in pairs]), 99) / np.percentile(without, 99))


class TimedLive(Live):
    """A slot that records the time of each scan."""

    def __init__(self) -> None:
        super().__init__()
        self.stamps: list[float] = []

    def show(self, look: Look) -> None:
        """Store one snapshot."""
        self.stamps.append(time.perf_counter())
        super().show(look)


def measure(pairs: int, length: float, folder: Path, done: Callable[[Sequence[Pair]], None]) -> list[Pair]:
    """Serve a simulated cell in real time, run after run, and return the jitter of each pair.

    Within a pair, pages open and close repeatedly. The order balances slow changes, such as the work of a run, between
    both. Another process reads the pages, as browsers on other computers do.

    Args:
        pairs: Number of pairs.
        length: Time with pages, and time without, of each pair, s.
        folder: Folder of the records.
        done: Called after each pair, with all pairs so far.
    """
    found = list[Pair]()
    with _serving(folder) as (server, live, period), watched(server) as set_open:
        for number in range(pairs):
            gaps: dict[bool, list[float]] = {False: [], True: []}
            used = 0.0
            for turn in TURNS:
                has_pages = turn != bool(number % 2)
                set_open(has_pages)
                before = _thread_time()
                gaps[has_pages] += _stretch(live, period, 2 * length / len(TURNS))
                used += _thread_time() - before if has_pages else 0.0
            found.append(Pair(gaps[False], gaps[True], used / length))
            done(found)
    return found


def _thread_time() -> float:
    """Return the processor time of the page's thread so far, s."""
    thread = next(thread for thread in threading.enumerate() if thread.name == THREAD)
    return int(Path(f"/proc/self/task/{thread.native_id}/schedstat").read_text().split()[0]) / 1e9


def _p99(jitter: Sequence[float]) -> float:
    return float(np.percentile(jitter, 99)) if len(jitter) else math.nan


def _stretch(live: TimedLive, period: float, length: float) -> list[float]:
    live.stamps.clear()
    threading.Event().wait(length)
    stamps = list(live.stamps)
    # Between two runs the scan also opens and closes records; such an interval is not the interval of a scan.
    return [abs(gap - period) for gap in np.diff(stamps).tolist() if gap < 10 * period]


@contextmanager
def watched(server: PageServer) -> Iterator[Callable[[bool], None]]:
    """Yield a function that opens and closes pages in another process."""
    host, port = server.address
    command = [sys.executable, "-m", "cell.lab.page.watcher", f"ws://{host}:{port}/live", str(PAGES)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        into, out = process.stdin, process.stdout
        assert into is not None
        assert out is not None
        is_open = False

        def set_open(shall_be: bool) -> None:
            nonlocal is_open
            if shall_be != is_open:
                into.write("open\n" if shall_be else "close\n")
                into.flush()
                out.readline()
                is_open = shall_be

        try:
            yield set_open
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
            if report.state == State.ABORTED:  # a computer too slow for the scan ends a run with a fault
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
