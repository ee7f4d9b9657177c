"""Views of the page in 3D and flat, its weight and its accessibility, in a real browser."""

import gzip
import json
import re

import numpy as np
import pytest

from cell.page.server import STATIC
from drivers.arm.kinematics import finger_frame
from drivers.errors import SkinSilentError
from drivers.scene_facts import BRIGHT, NOISE, felt, touch_colours
from tests.browser import PageView, browsing
from tests.filmed_runs import record
from tests.foreign import NODE_CLIENT
from tests.page_user import get
from tests.trouble import until

AXE = NODE_CLIENT / "node_modules" / "axe-core" / "axe.min.js"
FIRST, WHOLE = 40e3, 1e6
"""Most bytes until state and Stop are there, compressed as they are sent, and of all files of the page, bytes."""
SHOWN = """
const offer = document.getElementById('load-scene'); // on a computer that is too busy for the page
if (offer && offer.getBoundingClientRect().height) offer.click();
const canvas = document.getElementById('scene-canvas'), isDrawn = canvas.width !== 300; // what an empty one has
return isDrawn && canvas.getBoundingClientRect().height
"""
SHIFTS = """
const done = arguments[0];
new PerformanceObserver((list) => done(list.getEntries().map((entry) => [entry.value, ...entry.sources.map(({ node }) => node?.id)])))
  .observe({ type: 'layout-shift', buffered: true });
setTimeout(() => done([]), 500);
"""
MOST_SHIFT = 0.01
"""Largest cumulative layout shift while the page loads; 0.1 is called good by web.dev/articles/cls."""


@pytest.fixture(scope="module")
def browser():
    with browsing(has_webgl=True) as opened:
        yield opened


@pytest.fixture
def run(rig, served, server) -> int:
    """Return the number of a run on record, in which the hand closes on a peg."""
    number = record(rig, served.journal, knows_truth=True)
    until(lambda: get(server.address, f"/runs/{number}/replay")[0].status == 200)
    return number


@pytest.fixture
def view(browser, server):
    opened = []

    def view(path, using=browser):
        opened.append(PageView(using, server.url + path))
        return opened[-1]

    yield view
    for page in opened:
        page.close()


def answer_of(page, source):
    """Return the result of asynchronous JavaScript in a page."""
    text = f"const done = arguments[0]; (async () => {{ {source} }})().then(done, (error) => done(String(error)))"
    return page.front().execute_async_script(text)


def test_a_run_is_replayed_at_any_moment_from_its_samples_alone(view, run):
    page = view(f"runs/{run}")
    page.until(lambda: page.script(SHOWN) > 100)
    assert page.text("angle") == "11.5°"  # 0.2 rad, at the end
    page.script("const m = document.getElementById('moment'); m.value = 0; m.dispatchEvent(new Event('input'))")
    assert (page.text("time"), page.text("angle")) == ("0.00 s", "–")
    assert page.complaints() == []


def test_the_hand_is_drawn_where_the_arm_has_it(view, run, loaded):
    arm = loaded.cell.arm_model()
    joints = np.array(arm.home) + np.random.default_rng(3).uniform(-0.5, 0.5, len(arm.home))
    page = view(f"runs/{run}")
    drawn = answer_of(
        page,
        f"const data = await (await fetch('/runs/{run}/replay')).arrayBuffer();"
        "const length = new DataView(data).getUint32(0, true);"
        "const facts = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length))).scene;"
        "const { CellScene } = await import('/scene.js'), { Vector3 } = await import('/three-min.js');"
        "const cell = new CellScene(document.createElement('canvas'), facts);"
        f"cell.pose({{ joints: {joints.tolist()}, width: 0.01, peg: null, values: facts.taxels.map((t) => t.map(() => 0)) }});"
        "return cell.flange.localToWorld(new Vector3(0, 0, facts.hand.centre)).toArray()",
    )
    assert drawn == pytest.approx(finger_frame(arm, joints).position, abs=1e-6)


def test_the_page_has_the_colours_of_every_other_picture(view):
    page = view("")
    page.until_text("link", "live")
    counts = np.array([-300.0, NOISE - 1, NOISE, 4000.0, 9000.0, BRIGHT, 2 * BRIGHT])
    scale = json.dumps({"least": NOISE, "most": BRIGHT})
    shown = answer_of(
        page,
        "const { felt, touchColour } = await import('/paint.js'); const told = await new Promise((hear) => {"
        " const s = new WebSocket(`ws://${location.host}/live`); s.onmessage = (e) => { const d = JSON.parse(e.data);"
        " if (d.kind === 'hello') { s.close(); hear(d.scene.colours); } }; });"
        f"return {counts.tolist()}.map((counts) => touchColour({{ ...told, ...{scale} }}, felt(told, counts)))",
    )
    assert np.array(shown) == pytest.approx(touch_colours(felt(counts)))


@pytest.mark.parametrize("width", [360, 1024, 1920])
def test_nothing_moves_while_the_page_loads_or_when_the_cell_is_drawn(view, server, width):
    page = view("runs/0")
    size = {"width": width, "height": 768, "deviceScaleFactor": 1, "mobile": False}
    page.front().execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    page.front().get(f"{server.url}#token={server.token}")
    page.until(lambda: page.is_enabled("start") and page.script(SHOWN) > 100)
    shifts = page.front().execute_async_script(SHIFTS)
    assert sum(value for value, *_ in shifts) < MOST_SHIFT, shifts


def test_without_webgl_only_the_flat_views_are_loaded(view, run):
    with browsing() as flat:
        page = PageView(flat, view("").script("return location.href"))
        page.until_text("age", "ms")
        assert not page.front().find_element("id", "scene-canvas").is_displayed()
        assert "no WebGL" in page.text("why-no-scene")
        assert page.front().find_element("id", "path").is_displayed()
        loaded = page.script("return performance.getEntriesByType('resource').map((entry) => entry.name)")
        assert not [name for name in loaded if "three" in name]
        flat.get(page.script("return location.origin") + f"/runs/{run}")
        page.until_text("replay-note", "no WebGL")
        assert page.text("angle") == "11.5°"


def test_state_and_stop_need_40_kilobytes_and_the_whole_page_a_megabyte(server):
    wanted, weight = ["page.css", "page.js"], len(gzip.compress(get(server.address, "/")[1]))
    for name in wanted:
        answer, body = get(server.address, f"/{name}", **{"Accept-Encoding": "gzip"})
        assert (answer.status, body[:2]) == (200, b"\x1f\x8b")
        weight += len(body)
        found = re.findall(r'^import .*?"\./([\w-]+\.js)";', gzip.decompress(body).decode(), re.M | re.S)
        wanted += [other for other in found if other not in wanted]
    assert "three-min.js" not in wanted
    assert weight < FIRST
    assert sum(file.stat().st_size for file in STATIC.iterdir()) < WHOLE


def asking(page, served, server):
    page.click("id", "unlock")


def faulted(page, served, server):
    served.program.may_end.clear()
    served.program.fault = SkinSilentError("skin: no frame for 0.5 s")
    page.script(f"location.hash = 'token={server.token}'; location.reload()")
    page.until(lambda: page.is_enabled("start"))
    page.press("start")
    page.until_text("state", "Aborted")
    page.script("document.getElementById('help-drawer').open = true")
    page.until_text("catalogue", "1001")


@pytest.mark.skipif(not AXE.is_file(), reason="`npm ci` was not run in tests/clients/node")
@pytest.mark.parametrize(("path", "reach"), [("", None), ("", asking), ("", faulted), ("runs/{}", None)])
def test_no_rule_of_accessibility_is_violated(view, served, server, run, path, reach):
    page = view(path.format(run))
    page.until(lambda: page.script(SHOWN) > 100)
    if reach is not None:
        reach(page, served, server)
    page.script(AXE.read_text(encoding="utf-8"))
    for scheme in ("light", "dark"):
        media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
        page.front().execute_cdp_cmd("Emulation.setEmulatedMedia", media)
        found = answer_of(page, "return (await axe.run()).violations.map((v) => [v.id, v.nodes.map((n) => n.html)])")
        assert found == [], json.dumps(found, indent=1)
