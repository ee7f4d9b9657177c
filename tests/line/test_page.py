"""The page in a real browser: a run watched, held and let go on, faults, leases, two pages, a server that comes back."""

import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager

import pytest

from cell.commands.cli import GOOD, main
from cell.film.recorded import recorded
from cell.lab.faults import program
from cell.records.journal import Journal
from drivers.errors import SkinSilentError
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import Refusal
from tests.browser import PageView, browsing
from tests.filmed_runs import require_rendering
from tests.plc_wire import Wire
from tests.quick_cell import CODE
from tests.trouble import until

WIRE_CUT = "skin: no frame for 0.5 s"


@pytest.fixture(scope="module")
def browser():
    with browsing() as opened:
        yield opened


@pytest.fixture
def open_page(browser, server) -> Iterator[Callable[..., PageView]]:
    opened = []

    def open_page(token: str = "") -> PageView:
        opened.append(view(browser, server.address, token))
        opened[-1].until_text("link", "live")
        return opened[-1]

    yield open_page
    for page in opened:
        page.close()


def view(browser, address, token=""):
    return PageView(browser, f"http://{address[0]}:{address[1]}/" + (f"#token={token}" if token else ""))


@pytest.fixture
def page(open_page, server) -> PageView:
    page = open_page(server.token)
    page.until(lambda: page.is_enabled("start"))
    return page


def test_a_run_is_held_resumed_and_ended_from_the_page(served, page):
    serial = "SN-0123456789-ABCDEFGHIJKLMNOPQR"
    assert len(serial) == 32
    page.front().find_element("id", "serial").send_keys(serial)
    served.program.may_end.clear()
    page.press("start")
    page.until_text("state", "Execute")
    page.press("hold")
    page.until_text("state", "Held")
    assert not page.is_enabled("hold")
    page.press("unhold")
    page.until_text("state", "Execute")
    served.program.may_end.set()
    page.until_text("state", "Complete")
    page.until_text("run-rows", "success")
    page.until_text("run-rows", serial)
    assert served.record(1).source.startswith("page 127.0.0.1")
    assert page.complaints() == []


def test_a_requested_film_is_shown_once_drawn_and_at_once_later(served, page, tmp_path):
    page.press("start")
    page.until_text("run-rows", "success")
    with Journal(served.folder, is_read_only=True) as journal:
        require_rendering(recorded(journal, 1))
    page.click("link text", "Run 1")
    page.until(lambda: page.front().find_element("id", "make-film").is_displayed())
    page.click("id", "make-film")
    page.until_text("film-note", "Drawing the film")
    # As the page's own process does, which has low priority and may take minutes.
    assert main(["film", "1", "--journal", str(served.folder), "--out", str(tmp_path / "film.mp4")]) == GOOD
    (tmp_path / "film.mp4").replace(served.folder / "run-000001.mp4")
    film = "const film = document.getElementById('film'); return film.readyState >= 2 && film.videoWidth"
    for reload in (True, False):
        page.until(lambda: page.script(film) == 1280)
        assert page.front().find_element("id", "film").is_displayed()
        assert not page.front().find_element("id", "make-film").is_displayed()
        assert page.text("film-note") == ""
        if reload:
            page.front().refresh()
    assert page.complaints() == []


def test_a_fault_shows_its_remedy_and_is_reset_from_the_page(served, page):
    served.program.may_end.clear()
    served.program.fault = SkinSilentError(WIRE_CUT)
    page.press("start")
    page.until_text("state", "Aborted")
    assert page.text("fault-title") == "Fault 1001: no taxel frame arrived in time"
    assert page.text("fault-message") == WIRE_CUT
    assert "check the board's supply and cable" in page.text("fault-remedy")
    page.until_text("fault-list", "active")
    page.until_text("age", "no news for")
    page.press("reset")
    page.until_text("answer", "Reset: the state is idle.")
    page.until_text("state", "Idle")
    page.until_text("fault-list", "over")
    for wanted, found in (("1001", "no taxel frame arrived in time"), ("2003", "None on record.")):
        page.front().find_element("id", "alarm-search").clear()
        page.front().find_element("id", "alarm-search").send_keys(wanted)
        page.until_text("fault-list", found)
    page.until(lambda: not page.text("fault-title"))


def test_a_simulated_cable_is_pulled_and_plugged_from_the_page(served, page, open_page):
    served.program.may_end.clear()
    page.press("start")
    page.until_text("state", "Execute")
    page.click("css selector", "[data-cable=skin]")
    page.until_text("state", "Aborted")
    page.until_text("cable-skin", "Plug the skin in")
    assert page.text("next").startswith("Plug in what was pulled out: skin.")
    late = open_page()
    late.until_text("age", "no news for")
    assert late.text("switch") == "not read"
    page.click("css selector", "#fault-run a")  # one tap to the replay, with few requests before it is shown
    page.until_text("time", "s")
    page.until_text("event-rows", "skin unplugged")
    asked = page.script("return performance.getEntriesByType('resource').map((entry) => entry.encodedBodySize)")
    assert (len(asked) <= 13, sum(asked) < 100_000) == (True, True), asked
    page.front().back()
    page.until(lambda: page.is_enabled("reset"))
    page.click("css selector", "[data-cable=skin]")
    page.until_text("cable-skin", "Unplug the skin")
    page.press("reset")
    page.until_text("state", "Idle")
    assert page.front().find_element("css selector", "#run-rows td:last-child").text == "fault 1001"
    assert page.complaints() == []


def test_while_a_plc_holds_the_lease_the_page_may_only_stop(served, page, plc: Wire):
    served.program.may_end.clear()
    plc.order((1, 0), (2, CODE))
    page.until_text("state", "Execute")
    page.until_text("lease", "127.0.0.1:")
    assert not page.is_enabled("hold")
    page.press("hold")
    page.until_text("answer", "holds the lease")
    page.press("stop")
    page.until_text("state", "Stopped")
    assert served.record(1).outcome == "aborted"


def test_a_page_without_the_token_may_only_look(served, open_page):
    page = open_page()
    assert "may only look" in page.text("locked")
    page.press("start")
    page.until_text("answer", "unlock the controls first")
    page.click("css selector", "[data-cable=skin]")
    page.until_text("answer", "The cable stays as it is: this page may only look")
    wrong = open_page("wrong")
    wrong.until_text("answer", "not the token of this cell")
    assert served.bridge.run == 0


def test_two_pages_show_the_same_and_one_holds_the_lease(served, page, open_page, server):
    other = open_page(server.token)
    served.program.may_end.clear()
    page.press("start")
    for seen in (page, other):
        seen.until_text("state", "Execute")
    other.until(lambda: other.is_enabled("stop") and not other.is_enabled("hold"))
    page.press("hold")
    other.until_text("state", "Held")
    served.program.may_end.set()


def test_the_page_loads_from_the_cell_and_every_control_has_a_name(page):
    hosts = page.script(
        "return [...new Set(performance.getEntriesByType('resource').map((e) => new URL(e.name).host))]"
    )
    assert hosts == [page.script("return location.host")]
    nameless = page.script(
        "return [...document.querySelectorAll('button,input,select,canvas,progress,[tabindex]')].filter((e) =>"
        " !(e.textContent.trim() || e.getAttribute('aria-label') || e.getAttribute('aria-labelledby') ||"
        " (e.labels && e.labels.length))).map((e) => e.outerHTML)"
    )
    assert nameless == []
    focused = "document.querySelector('[data-ask=hold]').focus(); return document.activeElement.textContent"
    assert page.script(focused) == "Hold"


WAYS = [
    (["start"], "Execute"),
    (["hold"], "Held"),
    (["stop"], "Stopped"),
    (["reset"], "Idle"),
    (["start", "abort"], "Aborted"),
]
"""Controls pressed one after another, and the state that follows."""
SIZES = [(360, 740, "dark"), (360, 740, "light"), (1024, 768, "light"), (1920, 1080, "light")]
"""Width and height of the view, pixels, and the colours that the user prefers."""
PLACE = """
const r = document.querySelector(`[data-ask=${arguments[0]}]`).getBoundingClientRect();
return [r.left, r.top, r.right, r.bottom, innerWidth, innerHeight];
"""
RED = "return getComputedStyle(document.querySelector('[data-ask=stop]')).backgroundColor"


def places_of_stop(page):
    """Return left, top, right, bottom of Stop and Abort and the size of the view, pixels, in views of every size."""
    places = []
    for width, height, scheme in SIZES:
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": True}
        page.front().execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
        page.front().execute_cdp_cmd("Emulation.setEmulatedMedia", media)
        for down in ("0", "document.body.scrollHeight"):  # scrolled to either end
            page.script(f"scrollTo(0, {down})")
            places.append([page.front().execute_script(PLACE, ask) for ask in ("stop", "abort")])
        assert places[-2] == places[-1]
        assert page.script(RED) == "rgb(179, 38, 30)"
        assert page.script("return document.documentElement.scrollWidth") <= width
    return places


def test_stop_and_abort_stay_in_view_at_one_place_in_every_state(served, page):
    first = places_of_stop(page)
    for left, top, right, bottom, across, down in (place for both in first for place in both):
        assert 0 <= left < right <= across
        assert 0 <= top < bottom <= down
        assert bottom - top >= 60
    served.program.may_end.clear()
    for asks, state in WAYS:
        for ask in asks:
            page.press(ask)
        page.until_text("state", state)
        assert places_of_stop(page) == first, state


@contextmanager
def serving_page(folder, port):
    """Yield a process that serves a cell with its page at a port."""

    def is_open():
        with closing(socket.socket()) as client:
            return client.connect_ex(("127.0.0.1", port)) == 0

    with program.served(folder, ["--set", "sim.pace=max", "--page", f"127.0.0.1:{port}"]) as running:
        until(is_open)
        yield running


def test_a_real_run_is_watched_and_a_page_outlives_a_killed_server(browser, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with serving_page(tmp_path, port) as running:
        page = view(browser, ("127.0.0.1", port), (tmp_path / "page-token").read_text())
        page.until(lambda: page.is_enabled("start"))
        page.press("start")
        page.until_text("doing", "spray search")
        page.until_text("state", "Complete")
        page.until_text("run-rows", "success")
        page.until_text("theta", "no peg")  # it stays in the hole
        assert page.text("yield") == "100.0 %"
        assert page.script("return document.getElementById('percent').textContent") == "100 %"
        page.click("link text", "Run 1")
        page.until_text("stage-rows", "spiral adjust")
        page.until_text("replay-note", "no WebGL")
        assert page.complaints() == []
        page.front().back()
        page.until_text("link", "live")
        running.signal(signal.SIGKILL)
        page.until_text("lost", "No connection to the cell")
    with serving_page(tmp_path, port) as running:
        page.until_text("link", "live")
        page.until_text("state", "Idle")
        page.until(lambda: page.is_enabled("start"))
        with closing(Peer(*running.address)) as peer:
            assert peer.look().refusal == Refusal.NONE
    page.complaints()  # those of the time without a server, which the next page shall not be asked about
    page.close()
    with Journal(tmp_path) as journal:
        assert [row.outcome for row in journal.runs(5)] == ["success"]
