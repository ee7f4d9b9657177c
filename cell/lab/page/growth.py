"""Memory growth of server and browser over hours of runs, and the time from an event to the screen."""

import gc
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from cell.config.load import load
from cell.config.parameters import PARAMETERS
from cell.lab.page.browser import browsing, memory_of
from cell.lab.page.replay import as_run
from cell.page.hub import PERIOD
from cell.page.server import PageServer
from cell.records.journal import Journal
from cell.records.schema import RunRow
from cell.records.wall_clock import now_text
from cell.run.line import PROGRAMS
from cell.run.live import KEPT, Live, Look
from cell.run.states import State
from plc_bridge.bridge import Bridge
from plc_bridge.messages import Report, Result
from skills.catalogue import CATALOGUE

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

PAGES = 2
WARM = 1.0
"""Simulated warm-up time, h, or a quarter of the measured time if that is less: buffers fill, code is compiled."""
STEP = 0.5
"""Simulated time between two memory samples, h."""
GAPS = (0.12, 0.3)
"""Smallest and largest time between two events, s."""
MEGABYTE = 1e6
_OBSERVE = """
window.seen = [];
new MutationObserver(() => requestAnimationFrame(() => window.seen.push(performance.timeOrigin + performance.now())))
  .observe(document.getElementById('state'), {characterData: true, childList: true, subtree: true});
"""


@dataclass(frozen=True, slots=True)
class Growth:
    """Growth over the runs after the warm-up."""

    what: str
    hours: float
    """Simulated time of those runs, h."""
    runs: int
    start: float
    """Memory after the warm-up, MB."""
    end: float
    """Memory at the end, MB."""

    @property
    def growth(self) -> float:
        """Return the growth, MB."""
        return self.end - self.start


@dataclass(frozen=True, slots=True)
class MemoryLook:
    """Memory at one time of the runs."""

    hours: float
    """Simulated time of the runs so far, including those of the warm-up, h."""
    runs: int
    memory: dict[str, float]
    """Memory by its owner, MB."""


@dataclass(slots=True)
class Stand:
    """A page served without a cell; the states and reports of a cell are written here."""

    server: PageServer
    bridge: Bridge
    live: Live
    journal: Journal

    @property
    def url(self) -> str:
        """Address of the page."""
        host, port = self.server.address
        return f"http://{host}:{port}/"


@contextmanager
def stand(folder: Path) -> Iterator[Stand]:
    """Yield a served page."""
    loaded = load()
    bridge, live = Bridge(loaded.cell.plc, PROGRAMS, PARAMETERS), Live()
    server = PageServer(("127.0.0.1", 0), bridge, live, loaded, folder)
    with Journal(folder) as journal:
        server.start()
        try:
            yield Stand(server, bridge, live, journal)
        finally:
            server.close()


@contextmanager
def shown(folder: Path) -> "Iterator[tuple[Stand, Chrome]]":
    """Yield a served page, and a browser that has it open."""
    with stand(folder) as page, browsing() as browser:
        open_pages(browser, page.url)
        yield page, browser


def measure_growth(
    page: Stand, browser: "Chrome", looks: list[Look], hours: float, seen: Callable[[float, MemoryLook | None], None]
) -> list[Growth]:
    """Show a run repeatedly to the pages of a browser, as fast as the slot accepts it; return the growth.

    Args:
        page: The served page.
        browser: The browser that has it open.
        looks: All snapshots of one run.
        hours: Total simulated time of the runs after the warm-up, h.
        seen: Called after each run with the completed share, and the memory if it was sampled.
    """
    length = (looks[-1].seen.stamp - looks[0].seen.stamp) / 3600.0
    warm = max(round(min(WARM, 0.25 * hours) / length), 1)
    runs, every = warm + max(round(hours / length), 4), max(round(STEP / length), 1)
    start = end = _memory(browser)
    for run in range(1, runs + 1):
        _show_run(page, looks, run)
        if run not in (warm, runs) and run % every:
            seen(run / runs, None)
            continue
        end = _memory(browser)
        start = end if run == warm else start
        seen(run / runs, MemoryLook(run * length, run, end))
    counted = runs - warm
    return [Growth(what, counted * length, counted, start[what], end[what]) for what in end]


def measure_latency(page: Stand, browser: "Chrome", looks: list[Look], events: int) -> list[float]:
    """Return the time from each published change of state to the frame that shows it, s, shortest first.

    Touch and traces are published meanwhile as in a run.
    """
    rng = np.random.default_rng(1)
    told = []
    run = page.journal.last_run() + 1
    page.bridge.publish(_report(run, State.EXECUTE))
    _until(lambda: browser.execute_script("return document.getElementById('state').textContent") == "Execute")
    browser.execute_script(_OBSERVE)
    for number in range(events):
        for look in as_run(looks[10 * number % len(looks) :][:10], run):
            page.live.show(look)
        told.append(time.time())
        page.bridge.publish(_report(run, State.EXECUTE if number % 2 else State.HELD))
        threading.Event().wait(float(rng.uniform(*GAPS)))
    _until(lambda: len(browser.execute_script("return window.seen")) >= events)
    seen = cast("list[float]", browser.execute_script("return window.seen"))
    return sorted(shown / 1e3 - sent for sent, shown in zip(told, seen, strict=True))


def open_pages(browser: "Chrome", url: str) -> None:
    """Open the pages, the last one in the foreground, and wait until they are live."""
    for number in range(PAGES):
        if number:
            browser.switch_to.new_window("tab")
        browser.get(url)
        _until(lambda: browser.execute_script("return document.body.dataset.link") == "live")


def _show_run(page: Stand, looks: list[Look], run: int) -> None:
    row = page.journal.begin(RunRow(0, now_text(), "insert_peg", 0, f"A-{run}", "study", run))
    page.bridge.publish(_report(row.run, State.EXECUTE))
    shown = as_run(looks, row.run)
    for first in range(0, len(shown), KEPT):
        for look in shown[first : first + KEPT]:
            page.live.show(look)
        threading.Event().wait(PERIOD)
    page.journal.finish(RunRow(row.run, row.started, "insert_peg", 0, row.serial, "study", run, outcome="success"))
    page.bridge.publish(_report(row.run, State.COMPLETE))


def _report(run: int, state: State) -> Report:
    stage = next(iter(CATALOGUE.stages))
    result = Result.SUCCESS if state is State.COMPLETE else Result.NONE
    return Report(sequence=run % 0x10000, state=state, result=result, run=run, stage=stage)


def _memory(browser: "Chrome") -> dict[str, float]:
    gc.collect()
    heap = 0.0
    for handle in browser.window_handles:
        browser.switch_to.window(handle)
        browser.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
        browser.execute_cdp_cmd("Performance.enable", {})
        metrics: Any = browser.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
        heap += next(metric["value"] for metric in metrics if metric["name"] == "JSHeapUsedSize")
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return {
        "server": pages * 4096 / MEGABYTE,
        "JavaScript of both pages": heap / MEGABYTE,
        "browser, all processes": memory_of(browser) / MEGABYTE,
    }


def _until(is_met: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 30.0
    while not is_met():
        if time.monotonic() > deadline:
            raise RuntimeError("the page does not show what it is told")
        threading.Event().wait(0.05)
