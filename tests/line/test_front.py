"""The guard in front of every route: it answers only requests of the cell's own page under a name of the cell."""

import http.server
import threading
import urllib.request
from collections.abc import Iterator

import pytest
from tornado.routing import Rule

from cell.config.cell_config import PageConfig
from cell.config.load import LoadedConfig
from cell.page.front import HttpServer
from cell.page.guard import is_private
from cell.page.server import MetricsServer, PageServer
from tests.browser import browsing
from tests.certificates import Authority
from tests.page_user import get
from tests.quick_cell import QuickCell

EXAMPLES = {
    "/faults$": "/faults",
    "/alarms$": "/alarms",
    "/report.html$": "/report.html",
    "/live$": "/live",
    r"/runs/(\d{1,9})/(data|config)$": "/runs/1/data",
    r"/runs/(\d{1,9})/replay$": "/runs/1/replay",
    r"/runs/(\d{1,9})/film\.mp4$": "/runs/1/film.mp4",
    r"/runs/\d{1,9}$": "/runs/1",
    r"/([\w-]+\.(?:html|js|css|svg))$": "/page.js",
    "/$": "/",
    "/metrics$": "/metrics",
}
"""A path of each route."""
UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}
FOREIGN = [
    {"Host": "evil.example"},
    {"Host": "evil.example", "Origin": "http://evil.example"},
    {"Host": "evil.example", "Origin": "http://evil.example", "Sec-Fetch-Site": "same-origin"},
    {"Origin": "http://evil.example"},
    {"Origin": "null", "Sec-Fetch-Site": "same-origin"},
    {"Origin": "http://["},
]


def page(served: QuickCell, loaded: LoadedConfig, host: str = "127.0.0.1", port: int = 0) -> PageServer:
    return PageServer((host, port), served.bridge, served.live, loaded, served.folder)


@pytest.fixture(params=["page", "metrics"])
def server(request, served: QuickCell, loaded) -> Iterator[HttpServer]:
    is_page = request.param == "page"
    with page(served, loaded) if is_page else MetricsServer(("127.0.0.1", 0), served.bridge, loaded.cell) as made:
        yield made


def pattern(rule: Rule) -> str:
    return rule.matcher.regex.pattern  # type: ignore[attr-defined]


def status(server: HttpServer, method: str, path: str, headers: dict[str, str]) -> int:
    return get(server.address, path, method, **(UPGRADE if path == "/live" else {}), **headers)[0].status


def test_a_foreign_name_or_page_gets_421_on_every_route(server):
    paths = [EXAMPLES[pattern(rule)] for rule in server.routes.wildcard_router.rules]
    for path in [*paths, "/nothing"]:
        for method in ("GET", "HEAD", "POST", "OPTIONS", "PUT"):
            for headers in FOREIGN:
                assert status(server, method, path, headers) == 421, (method, path, headers)


def test_every_route_answers_its_own_page(server):
    own = {"Origin": "http://{}:{}".format(*server.address)}
    for rule in server.routes.wildcard_router.rules:
        assert status(server, "GET", EXAMPLES[pattern(rule)], own) in (101, 200, 404)


def with_keys(loaded, folder, **page):
    """Return the config of a cell with keys, and a client's context that trusts them."""
    authority = Authority(folder)
    plc = loaded.cell.plc.model_copy(update={"tls": authority.cell()})
    cell = loaded.cell.model_copy(update={"plc": plc, "page": PageConfig(**page)})
    return LoadedConfig({0: cell}), authority.client()


def test_a_page_for_other_computers_speaks_tls_with_the_keys_of_the_cell(served, loaded, tmp_path):
    keyed, trust = with_keys(loaded, tmp_path / "keys")
    with page(served, keyed, "0.0.0.0") as server:
        assert server.url.startswith("https://")
        with urllib.request.urlopen(f"https://127.0.0.1:{server.address[1]}/", timeout=10, context=trust) as answer:
            assert answer.status == 200
    with page(served, keyed) as server:
        assert server.url.startswith("http://")


def test_a_name_of_the_config_is_answered_as_a_proxy_sends_it(served, loaded, tmp_path):
    named, _ = with_keys(loaded, tmp_path / "keys", names=["Cell-7.plant.example"])
    with page(served, named) as server:
        own = {"Host": "cell-7.plant.example", "Origin": "https://cell-7.plant.example"}
        assert status(server, "GET", "/", own) == 200
        assert status(server, "GET", "/", {"Host": "cell-8.plant.example"}) == 421


@pytest.mark.parametrize(
    ("protocol", "peer", "may"),
    [
        ("http", "127.0.0.1", True),
        ("http", "::1", True),
        ("http", "10.0.0.5", False),
        ("https", "10.0.0.5", True),
        ("http", "", False),
    ],
)
def test_a_token_is_taken_where_nobody_on_the_way_reads_it(protocol, peer, may):
    assert is_private(protocol, peer) is may


class Attacker(http.server.BaseHTTPRequestHandler):
    """A foreign site whose name leads to the cell later."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>attack</title>")

    def log_message(self, *_: object) -> None:
        pass


ATTACK = """
const done = arguments[arguments.length - 1], paths = arguments[0], found = {};
for (const path of paths) {
  const answer = await fetch(path, path.startsWith("/live") ? {} : {cache: "no-store"}).catch((error) => ({status: String(error)}));
  found[path] = answer.status;
}
const socket = new WebSocket(`ws://${location.host}/live`);
socket.onmessage = () => done({...found, socket: "heard"});
socket.onclose = () => done({...found, socket: "closed"});
"""


def test_a_rebound_name_reads_nothing_in_a_real_browser(served, loaded):
    with browsing("evil.example") as browser:
        site = http.server.HTTPServer(("127.0.0.1", 0), Attacker)
        port = site.server_port
        thread = threading.Thread(target=site.serve_forever)
        thread.start()
        browser.get(f"http://evil.example:{port}/")
        site.shutdown()
        thread.join()
        site.server_close()
        with page(served, loaded, port=port) as server:
            paths = [EXAMPLES[pattern(rule)] for rule in server.routes.wildcard_router.rules]
            found = browser.execute_async_script(ATTACK, paths)
            assert found == {**dict.fromkeys(paths, 421), "socket": "closed"}
            browser.get(f"http://127.0.0.1:{port}/")
            assert "Tactile insertion cell" in browser.title
