"""The page's server on its wire: answers, rights and the cost of one peer."""

import asyncio
import json
import socket
import sqlite3
from contextlib import AsyncExitStack, asynccontextmanager, closing

import pytest
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

from cell.config.load import LoadedConfig
from cell.page.hub import PLACES, PLACES_OF_ONE
from cell.page.server import PageServer
from cell.page.socket import TRIES
from cell.records.journal import INDEX
from cell.records.schema import ConfigRow, RunRow
from cell.records.wall_clock import now_text
from drivers.errors import DeviceNotOpenedError
from plc_bridge.protocol.messages import Control
from tests.hostile import UPGRADE
from tests.page_user import get
from tests.plc_wire import Wire
from tests.quick_cell import CODE
from tests.scenes import played
from tests.sockets import PATIENCE
from tests.trouble import until

PING = b"\x89\x00"


@asynccontextmanager
async def connected(server):
    """Yield the connection of a page of this cell, which is closed afterwards."""
    place = "{}:{}".format(*server.address)
    page = await websocket_connect(HTTPRequest(f"ws://{place}/live", headers={"Origin": f"http://{place}"}))
    stream = page.protocol.stream
    try:
        yield page
    finally:
        page.close()
        stream.close()


@asynccontextmanager
async def unlocked(server):
    """Yield such a connection with the token, and its source."""
    async with connected(server) as page:
        ask(page, "unlock", token=server.token)
        yield page, (await hear(page, "unlocked"))["source"]


async def hear(page, kind):
    """Return the next message of a kind."""
    while True:
        text = await asyncio.wait_for(page.read_message(), 10)
        assert text is not None, "closed"
        data = json.loads(text)
        if data["kind"] == kind:
            return data


async def closed(page):
    """Wait until the cell closes a page."""
    while await asyncio.wait_for(page.read_message(), 10) is not None:
        pass


def ask(page, what, **more):
    page.write_message(json.dumps({"ask": what, **more}))


def test_a_browser_may_load_from_the_cell_alone(server):
    answer, body = get(server.address, "/")
    assert answer.status == 200
    assert b"<main>" in body
    policy = answer.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert answer.headers["X-Content-Type-Options"] == "nosniff"


STATUS = {
    "/nothing": 404,
    "/..%2f..%2fserver.py": 404,
    "/runs/9": 200,
    "/runs/9/data": 404,
    "/runs/9/film.mp4": 404,
    "/runs/9/replay": 404,
    "/runs/9/picture.png": 404,
    "/report.html": 404,
    "/alarms?since=yesterday": 400,
}
"""Status of requests for absent things."""


def test_absent_things_have_a_status_and_browsers_keep_files_but_no_page(server):
    assert {path: get(server.address, path)[0].status for path in STATUS} == STATUS
    for path in ("/page.js", "/three-min.js"):
        first, body = get(server.address, path)
        again, nothing = get(server.address, path, **{"If-None-Match": first.headers["Etag"]})
        assert (first.status, first.headers["Cache-Control"], again.status, nothing) == (200, "no-cache", 304, b"")
        assert body
    for path in ("/", "/runs/1"):
        assert get(server.address, path)[0].headers["Cache-Control"] == "no-store"


def test_the_token_has_the_report_of_a_period_made(server, recorded):
    own = {"Authorization": f"Bearer {server.token}"}
    for since, headers, status in (("7d", {}, 401), ("never", own, 404), ("7d", own, 200)):
        assert get(server.address, f"/report.html?since={since}", "POST", **headers)[0].status == status
    answer, body = get(server.address, "/report.html")
    assert b"Times of successful runs" in body
    assert "script-src" not in answer.headers["Content-Security-Policy"]


def test_a_port_in_use_is_reported_in_one_line(server, served, loaded):
    other = PageServer(server.address, served.bridge, served.live, loaded, served.folder)
    with pytest.raises(DeviceNotOpenedError, match=r"^--page 127\.0\.0\.1:[^\n]*cannot listen[^\n]*$"):
        other.start()
    other.close()


@played
async def test_without_the_token_nothing_moves_and_guessing_ends(server, served, caplog):
    async with connected(server) as page:
        for what in ("start", "stop", "take", "abort"):
            ask(page, what, program="insert_peg")
            assert "may only look" in (await hear(page, "refused"))["why"]
        for _ in range(TRIES):
            ask(page, "unlock", token="guess")
        await closed(page)
    assert (served.bridge.run, served.bridge.holder) == (0, "")
    assert len(caplog.records) == 1  # guesses fill no log


@played
async def test_a_page_that_leaves_in_a_run_is_a_silent_plc(server, served):
    served.program.may_end.clear()
    async with unlocked(server) as (page, source):
        ask(page, "start", program="insert_peg")
        while not (await hear(page, "own"))["answered"]:
            pass
        assert source in served.bridge.kept
    assert source in served.bridge.kept  # its host may come back before the time-outs pass
    served.program.may_end.set()


def test_a_page_that_answers_no_ping_stays_open(served, loaded):
    plc = loaded.cell.plc.model_copy(update={"life_timeout": 0.1})
    busy = LoadedConfig({0: loaded.cell.model_copy(update={"plc": plc})})
    with (
        PageServer(("127.0.0.1", 0), served.bridge, served.live, busy, served.folder) as server,
        socket.create_connection(server.address, timeout=PATIENCE) as page,
    ):
        page.sendall(UPGRADE)
        received = b""
        while received.count(PING) < 5:
            more = page.recv(65536)
            assert more, "closed"
            received += more


@played
async def test_a_page_that_keeps_up_gets_the_history_once(server, served):
    served.program.may_end.clear()
    async with connected(server) as page:
        ask(page, "unlock", token=server.token)
        ask(page, "start", program="insert_peg")
        heard = []
        for what, state in [("", "EXECUTE"), *10 * [("hold", "HELD"), ("unhold", "EXECUTE")]]:
            if what:
                ask(page, what)
            while not heard or (heard[-1]["kind"], heard[-1].get("state")) != ("state", state):
                heard.append(json.loads(await asyncio.wait_for(page.read_message(), 10)))
    served.program.may_end.set()
    assert sum(each["kind"] == "history" for each in heard) == 1


@played
async def test_a_lease_is_free_once_the_page_releases_it(server, served, plc: Wire):
    served.program.may_end.clear()
    async with unlocked(server) as (page, _):
        ask(page, "take")
        assert (await hear(page, "own"))["lease"] in ("free", "yours")
        await asyncio.to_thread(until, lambda: served.bridge.holder.startswith("page"))
        plc.order((1, Control.NONE), (2, CODE))
        assert plc.answer(2).refusal == 5  # NOT_HOLDER
        ask(page, "release")
        await asyncio.to_thread(until, lambda: served.bridge.holder == "")
        plc.order((3, CODE))
        assert plc.answer(3).refusal == 0
        ask(page, "hold")
        while "another client holds the lease" not in ((await hear(page, "own"))["refusal"] or ""):
            pass
    served.program.may_end.set()


@pytest.fixture
def crowded(server, monkeypatch) -> PageServer:
    """As if each of 32 pages came from an address of its own."""
    monkeypatch.setattr("cell.page.hub.PLACES_OF_ONE", PLACES)
    return server


@played
async def test_an_operator_gets_in_however_many_only_look(crowded):
    async with AsyncExitStack() as open_pages:
        viewers = [await open_pages.enter_async_context(connected(crowded)) for _ in range(PLACES)]
        for viewer in viewers:
            await hear(viewer, "hello")
        late = await open_pages.enter_async_context(connected(crowded))
        assert "32 pages are open" in (await hear(late, "full"))["why"]
        _, source = await open_pages.enter_async_context(unlocked(crowded))
        assert source.startswith("page 127.0.0.1")
        await closed(viewers[-1])
        assert viewers[-1].close_code == 1013
        ask(viewers[0], "take")
        await hear(viewers[0], "refused")  # it is still shown everything
        await closed(late)
        assert late.close_code == 1013


@played
async def test_pages_with_the_token_leave_for_nobody(crowded):
    async with AsyncExitStack() as open_pages:
        for _ in range(PLACES):
            await open_pages.enter_async_context(unlocked(crowded))
        late = await open_pages.enter_async_context(connected(crowded))
        ask(late, "unlock", token=crowded.token)
        await closed(late)
        assert late.close_code == 1013


@played
async def test_one_address_has_only_so_many_places_to_look(server):
    async with AsyncExitStack() as open_pages:
        for _ in range(PLACES_OF_ONE):
            await hear(await open_pages.enter_async_context(connected(server)), "hello")
        late = await open_pages.enter_async_context(connected(server))
        assert "16 of them without the token at this address" in (await hear(late, "full"))["why"]


@played
async def test_what_no_parser_can_read_is_answered_in_one_line_and_logged_in_none(server, caplog):
    for text in ("[" * 2000, '{"ask": "unlock", "token": "\\ud800"}', "9" * 2000, "NaN", "\x00"):
        async with connected(server) as page:
            for _ in range(50):
                page.write_message(text)
                assert (await hear(page, "refused"))["why"] in ("not JSON", "an object with `ask` allowed")
    async with connected(server) as page:
        page.write_message("x" * 10_000)
        await closed(page)  # too long
    assert caplog.text == ""


@pytest.fixture
def recorded(served) -> int:
    """Return the number of a run on record."""
    journal = served.journal
    row = journal.writer.begin(
        RunRow(0, now_text(), "insert_peg", 0, "PN7[a]-[/x]", "10.0.0.5:1", 1, config_hash="abc")
    )
    journal.writer.keep_config(ConfigRow("abc", '{"journal": {"folder": "/home/somebody"}}'))
    assert journal.find(row.run)
    return row.run


def test_only_the_token_has_a_config_shown_or_a_file_made(server, served, recorded):
    config, film = f"/runs/{recorded}/config", f"/runs/{recorded}/film.mp4"
    assert [get(server.address, path)[0].status for path in (config, film)] == [401, 404]
    assert get(server.address, film, method="POST")[0].status == 401
    assert get(server.address, config, Authorization="Bearer guess")[0].status == 401
    own = {"Authorization": f"Bearer {server.token}"}
    answer, body = get(server.address, config, **own)
    assert (answer.status, json.loads(body)["journal"]) == (200, {"folder": "/home/somebody"})
    for path in (film, "/runs/99/data", "/runs/99/film.mp4"):
        for method in ("GET", "POST"):
            assert str(served.folder).encode() not in get(server.address, path, method=method, **own)[1]


def test_a_browser_that_leaves_during_a_film_is_no_error(server, served, recorded, caplog):
    film = served.folder / f"run-{recorded:06d}.mp4"
    film.write_bytes(bytes(64 * 1024 * 1024))
    with socket.create_connection(server.address) as browser:
        browser.sendall(f"GET /runs/{recorded}/film.mp4 HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
        assert browser.recv(12) == b"HTTP/1.1 200"
    size = 64 * 1024 * 1024
    for asked, status, part in (
        ("bytes=0-9", 206, f"bytes 0-9/{size}"),
        ("bytes=-10", 206, f"bytes {size - 10}-{size - 1}/{size}"),
        (f"bytes={size - 5}-{size + 500}", 206, f"bytes {size - 5}-{size - 1}/{size}"),
        (f"bytes={size}-", 416, f"bytes */{size}"),
    ):
        answer = get(server.address, f"/runs/{recorded}/film.mp4", Range=asked)[0]
        assert (answer.status, answer.headers["Content-Range"]) == (status, part)
    assert caplog.text == ""


def test_damage_in_the_index_is_answered_in_one_line(server, served, recorded):
    with closing(sqlite3.connect(served.folder / INDEX)) as index, index:
        index.execute("UPDATE runs SET serial = CAST(x'41ff' AS TEXT), cycle_time = CAST(x'ff' AS BLOB)")
    answer, body = get(server.address, f"/runs/{recorded}/data")
    assert (answer.status, body.count(b"\n")) == (404, 1)
