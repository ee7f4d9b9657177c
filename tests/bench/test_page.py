"""The page shows events at once, keeps no memory of past runs, and costs the scan little; run with nothing beside."""

import gc
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cell.config.load import load
from cell.config.parameters import PARAMETERS
from cell.devices.assembly import assemble, opened
from cell.page.front import THREAD
from cell.page.hub import PERIOD
from cell.page.server import PageServer
from cell.records.journal import Journal
from cell.records.schema import RunRow
from cell.records.wall_clock import now_text
from cell.run.line import PROGRAMS, TerminalLine
from cell.run.live import KEPT, Live
from cell.run.states import State
from cell.run.supervisor import Supervisor
from plc_bridge.bridge import Bridge
from plc_bridge.protocol.messages import FIRST_PROGRAM, Command, Report, Result
from skills.catalogue import CATALOGUE
from tests.bench.watched import PAGES, open_pages
from tests.browser import PageView, browsing
from tests.serving import process
from tests.trouble import until

WARM, RUNS = 20, 60
"""Number of shown runs until buffers are full, and of those in which memory must not grow."""
MOST_GROWTH = 3.0
"""Largest growth of the memory of both pages and of the server in those runs, MB."""
EVENTS, MOST_LATENCY = 100, 0.2
"""Number of changes of state, and the largest p95 of the time from one to the screen, s."""
MOST_REPLAY = 1.0
"""Longest time from a tap on the run of a fault to its touch, path, curves and 3D view, drawn without a graphics processor, s."""
SCAN, SCANS = 0.01, 1000
"""Period of the scan, s, and number of scans."""
MOST_SHARE, MOST_LATER = 0.15, 5e-3
"""Largest share of one core that the page's thread takes for two pages, and largest delay of the scans by it, s: half a period, and the time
after which the interpreter takes its lock from a thread."""
VISITS = 5
"""Number of times the replay is opened; the median counts."""
DRAWN = """
if (document.getElementById('scene-canvas')?.hidden !== false) return false;
requestAnimationFrame(() => { window.drawn ??= performance.now(); });
return window.drawn !== undefined;
"""
OBSERVE = """
window.seen = [];
new MutationObserver(() => requestAnimationFrame(() => window.seen.push(performance.timeOrigin + performance.now())))
  .observe(document.getElementById('state'), {characterData: true, childList: true, subtree: true});
"""


class KeptLive(Live):
    """A slot that keeps all snapshots."""

    def __init__(self):
        super().__init__()
        self.looks = []

    def show(self, look):
        self.looks.append(look)


@pytest.fixture(scope="module")
def looks(tmp_path_factory):
    """Return every snapshot of one run of the default simulated cell."""
    loaded, kept = load(sets=["sim.pace=max"]), KeptLive()
    with Journal(tmp_path_factory.mktemp("run") / "journal") as journal, opened(assemble(loaded.cell)) as cell:
        line = TerminalLine(Command(1, FIRST_PROGRAM, source="bench"), lambda report: report.result and served.quit())
        served = Supervisor(cell, loaded, line, journal, live=kept)
        served.serve()
    return [look for look in kept.looks if look.run]


class Stand:
    """A page served without a cell, whose states and snapshots are written here."""

    def __init__(self, folder):
        loaded = load()
        self.bridge, self.live = Bridge(loaded.cell.plc, PROGRAMS, PARAMETERS), Live()
        self.server = PageServer(("127.0.0.1", 0), self.bridge, self.live, loaded, folder)
        self.journal = Journal(folder)

    def report(self, run, state):
        """Publish a state of a run."""
        result = Result.SUCCESS if state is State.COMPLETE else Result.NONE
        stage = next(iter(CATALOGUE.stages))
        self.bridge.publish(Report(sequence=run % 0x10000, state=state, result=result, run=run, stage=stage))

    def show(self, looks, run):
        """Show snapshots as those of a run, no faster than the pages read them."""
        for number, look in enumerate(looks):
            self.live.show(replace(look, run=run))
            if number % KEPT == KEPT - 1:
                threading.Event().wait(PERIOD)


@pytest.fixture
def stand(tmp_path):
    made = Stand(tmp_path / "journal")
    with made.journal:
        made.server.start()
        yield made
        made.server.close()


@pytest.fixture
def shown(stand):
    """Yield a browser with both pages open, the last in the foreground."""
    host, port = stand.server.address
    with browsing() as browser:
        for number in range(PAGES):
            if number:
                browser.switch_to.new_window("tab")
            browser.get(f"http://{host}:{port}/")
            until(lambda: browser.execute_script("return document.body.dataset.link") == "live")
        yield browser


def memory(browser):
    """Return the memory of the server and of the pages' JavaScript, MB."""
    gc.collect()
    heap = 0.0
    for handle in browser.window_handles:
        browser.switch_to.window(handle)
        browser.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
        browser.execute_cdp_cmd("Performance.enable", {})
        metrics = browser.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
        heap += next(metric["value"] for metric in metrics if metric["name"] == "JSHeapUsedSize")
    return np.array([int(Path("/proc/self/statm").read_text().split()[1]) * 4096, heap]) / 1e6


def test_no_run_that_is_over_stays_in_memory(stand, shown, looks):
    for number in range(1, WARM + RUNS + 1):
        row = stand.journal.writer.begin(RunRow(0, now_text(), "insert_peg", 0, f"A-{number}", "bench", number))
        stand.report(row.run, State.EXECUTE)
        stand.show(looks, row.run)
        stand.journal.writer.finish(
            RunRow(row.run, row.started, "insert_peg", 0, row.serial, "bench", number, outcome="success")
        )
        stand.report(row.run, State.COMPLETE)
        if number == WARM:
            before = memory(shown)
    assert (memory(shown) - before).max() < MOST_GROWTH


def test_a_change_of_state_is_on_the_screen_within_a_fifth_of_a_second(stand, shown, looks):
    rng, told = np.random.default_rng(1), []
    stand.report(1, State.EXECUTE)
    until(lambda: shown.execute_script("return document.getElementById('state').textContent") == "Execute")
    shown.execute_script(OBSERVE)
    for number in range(EVENTS):
        stand.show(looks[10 * number % len(looks) :][:10], 1)
        told.append(time.time())
        stand.report(1, State.EXECUTE if number % 2 else State.HELD)
        threading.Event().wait(float(rng.uniform(0.12, 0.3)))
    until(lambda: len(shown.execute_script("return window.seen")) >= EVENTS)
    seen = np.array(shown.execute_script("return window.seen")) / 1e3
    assert np.percentile(seen - told, 95) < MOST_LATENCY


def test_a_fault_is_one_tap_and_less_than_a_second_from_its_replay(tmp_path):
    with (
        process(tmp_path, (), "--page", "127.0.0.1:0", lines=2) as (_, [_, (host, port)]),
        browsing(has_webgl=True) as browser,
    ):
        token = (tmp_path / "page-token").read_text(encoding="utf-8").strip()
        page = PageView(browser, f"http://{host}:{port}/#token={token}")
        page.until(lambda: page.is_enabled("start"))
        page.press("start")
        page.until_text("doing", "tactile insert")
        page.click("css selector", "[data-cable=skin]")
        page.until_text("state", "Aborted")
        page.click("css selector", "#fault-run a")
        took = []
        for visit in range(VISITS):
            if visit:
                page.front().refresh()
            page.until(lambda: page.script(DRAWN))
            took.append(page.script("return window.drawn"))
        assert np.median(took) < 1e3 * MOST_REPLAY, took


def page_time():
    """Return the processor time of the page's thread so far, s."""
    thread = next(thread for thread in threading.enumerate() if thread.name == THREAD)
    return int(Path(f"/proc/self/task/{thread.native_id}/schedstat").read_text().split()[0]) / 1e9


def lateness(stand, looks):
    """Show snapshots at the rate of the scan; return the p99 of the wall time from the instant of a scan to its start, s."""
    due, late = time.monotonic(), []
    for look in looks[:SCANS]:
        due += SCAN
        threading.Event().wait(max(due - time.monotonic(), 0.0))
        late.append(time.monotonic() - due)
        stand.live.show(look)
    return float(np.percentile(late, 99))


def test_two_pages_take_a_small_share_of_the_processor_and_delay_no_scan(stand, looks):
    stand.report(1, State.EXECUTE)
    alone = lateness(stand, looks)
    with open_pages(stand.server.address):
        before, began = page_time(), time.monotonic()
        beside = lateness(stand, looks)
        share = (page_time() - before) / (time.monotonic() - began)
        stand.report(1, State.COMPLETE)
    assert share < MOST_SHARE
    assert beside - alone < MOST_LATER
