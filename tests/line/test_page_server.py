"""The page's server on its wire: who is answered, who may command, and what one peer costs."""

import asyncio
import http.client
import json
from collections.abc import Iterator
from contextlib import AsyncExitStack, asynccontextmanager

import pytest
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

from cell.journal import Journal
from cell.journal_schema import RunRow
from cell.page.server import PageServer
from cell.page.socket import PLACES, TRIES
from cell.wall_clock import now_text
from drivers.errors import DeviceNotOpenedError
from plc_bridge.messages import Control
from tests.browser import patience
from tests.plc_wire import Wire
from tests.quick_cell import CODE, QuickCell


@pytest.fixture
def server(served: QuickCell, loaded) -> Iterator[PageServer]:
    made = PageServer(("127.0.0.1", 0), served.bridge, served.live, loaded, served.folder)
    made.start()
    yield made
    made.close()


def get(server, path, **headers):
    connection = http.client.HTTPConnection(*server.address, timeout=10)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer, body


@asynccontextmanager
async def connected(server, **headers):
    """Yield a page's connection, which is closed afterwards."""
    host, port = server.address
    page = await websocket_connect(HTTPRequest(f"ws://{host}:{port}/live", headers=headers))
    stream = page.protocol.stream
    try:
        yield page
    finally:
        page.close()
        stream.close()


async def hear(page, kind):
    """Return the next message of a kind."""
    while True:
        text = await asyncio.wait_for(page.read_message(), 10)
        assert text is not None, "closed"
        data = json.loads(text)
        if data["kind"] == kind:
            return data


def ask(page, what, **more):
    page.write_message(json.dumps({"ask": what, **more}))


def origin(server):
    return "http://{}:{}".format(*server.address)


def test_a_browser_may_load_from_the_cell_alone(server):
    answer, body = get(server, "/")
    assert answer.status == 200
    assert b"<main>" in body
    policy = answer.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert answer.headers["X-Content-Type-Options"] == "nosniff"


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/nothing", 404),
        ("/..%2f..%2fserver.py", 404),
        ("/runs/9", 200),
        ("/runs/9/data", 404),
        ("/runs/9/film.mp4", 404),
    ],
)
def test_what_there_is_not_is_answered_so(server, path, status):
    assert get(server, path)[0].status == status


def test_a_port_in_use_is_said_in_one_line(server, served, loaded):
    other = PageServer(server.address, served.bridge, served.live, loaded, served.folder)
    with pytest.raises(DeviceNotOpenedError, match=r"--page 127\.0\.0\.1:.*cannot listen"):
        other.start()
    other.close()


def test_without_the_token_nothing_moves_and_guessing_ends(server, served):
    async def guess():
        async with connected(server, Origin=origin(server)) as page:
            for what in ("start", "stop", "take", "abort"):
                ask(page, what, program="insert_peg")
                assert "may only look" in (await hear(page, "refused"))["why"]
            for _ in range(TRIES):
                ask(page, "unlock", token="guess")
            while await asyncio.wait_for(page.read_message(), 10) is not None:
                pass

    asyncio.run(guess())
    assert (served.bridge.run, served.bridge.holder) == (0, "")


def test_a_page_that_goes_away_in_a_run_is_a_plc_that_falls_silent(server, served):
    async def leave():
        async with connected(server, Origin=origin(server)) as page:
            ask(page, "unlock", token=server.token)
            source = (await hear(page, "unlocked"))["source"]
            ask(page, "start", program="insert_peg")
            while not (await hear(page, "own"))["answered"]:
                pass
            assert source in served.bridge.kept
            page.close()
            return source

    served.program.may_end.clear()
    source = asyncio.run(leave())
    assert source in served.bridge.kept  # its host may come back before the time-outs pass
    served.program.may_end.set()


def test_an_old_hand_on_the_lease_is_let_go_by_releasing_it(server, served, plc: Wire):
    async def hold_it():
        async with connected(server, Origin=origin(server)) as page:
            ask(page, "unlock", token=server.token)
            ask(page, "take")
            assert (await hear(page, "own"))["lease"] in ("free", "yours")
            await asyncio.to_thread(patience, lambda: served.bridge.holder.startswith("page"))
            plc.order((1, Control.NONE), (2, CODE))
            assert plc.answer(2).refusal == 5  # NOT_HOLDER
            ask(page, "release")
            await asyncio.to_thread(patience, lambda: served.bridge.holder == "")

    asyncio.run(hold_it())
    plc.order((3, CODE))
    assert plc.answer(3).refusal == 0


def test_there_are_only_so_many_places(server):
    async def crowd():
        async with AsyncExitStack() as open_pages:
            for _ in range(PLACES):
                await hear(await open_pages.enter_async_context(connected(server)), "hello")
            late = await open_pages.enter_async_context(connected(server))
            assert await asyncio.wait_for(late.read_message(), 10) is None
            assert late.close_code == 1013

    asyncio.run(crowd())


def test_too_long_a_text_closes_the_page(server):
    async def flood():
        async with connected(server) as page:
            page.write_message("x" * 10_000)
            while await asyncio.wait_for(page.read_message(), 10) is not None:
                pass

    asyncio.run(flood())


def test_a_run_on_record_is_told_whole(server, served):
    with Journal(served.folder) as journal:
        begun = journal.begin(RunRow(0, now_text(), "insert_peg", 0, "PN7[a]-[/x]", "10.0.0.5:1", 1))
    answer, body = get(server, f"/runs/{begun.run}/data")
    data = json.loads(body)
    assert (answer.status, data["serial"], data["files"]) == (200, "PN7[a]-[/x]", [])
