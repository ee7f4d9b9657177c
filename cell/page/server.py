"""The server of the page: a thread of its own with its own event loop, beside the scan, which it only looks at."""

import asyncio
import hashlib
import json
import socket as sockets
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.ioloop import PeriodicCallback
from tornado.web import Application, HTTPError, RequestHandler

from cell.config import LoadedConfig
from cell.live import Live
from cell.page.commands import MOST
from cell.page.guard import headers, is_own_host, part_of
from cell.page.hub import PERIOD, SPECTATOR, PageHub
from cell.page.records import FILES, FILM, Records
from cell.page.socket import PageSocket
from cell.page.token import page_token
from drivers.errors import CellError, DeviceNotOpenedError, JournalError
from plc_bridge.bridge import Bridge

STATIC = Path(__file__).parent / "static"
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".mp4": "video/mp4",
}
THREAD = "page"
"""Name of the thread that serves."""
PIECE = 256 * 1024
"""Size of the pieces in which a file is sent, bytes."""
PINGS = 3
"""Number of pings in the time for which a link may be silent."""


class PageServer:
    """The page of one cell that is served.

    Constructing touches nothing. `start` opens the port; `close` may be called again.

    Args:
        address: Host and port; port 0 takes a free one.
        bridge: The mailbox of the line.
        live: The slot that the scan fills.
        loaded: The cell and its recipes.
        folder: Folder of the records.
        cables: Names of the simulated devices whose cables the page may pull out.
    """

    def __init__(
        self,
        address: tuple[str, int],
        bridge: Bridge,
        live: Live,
        loaded: LoadedConfig,
        folder: Path,
        cables: Sequence[str] = (),
    ) -> None:
        self._asked, self._bridge, self._live, self._loaded, self._folder = address, bridge, live, loaded, folder
        self._cables = tuple(cables)
        self._socket: sockets.socket | None = None
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._is_over: asyncio.Event | None = None
        self.token = ""
        """Token that a page has to show before it may move anything."""

    @property
    def address(self) -> tuple[str, int]:
        """Host and port that the server listens on."""
        assert self._socket is not None
        host, port = self._socket.getsockname()[:2]
        return host, port

    def start(self) -> None:
        """Listen for browsers.

        Raises:
            DeviceNotOpenedError: The port is in use, or the address is not this computer's.
            ConfigError: The token cannot be kept.
        """
        host, port = self._asked
        self.token = page_token(self._folder)
        try:
            family = sockets.AF_INET6 if ":" in host else sockets.AF_INET
            self._socket = sockets.create_server((host, port), family=family)
        except (OSError, UnicodeError) as error:
            raise DeviceNotOpenedError(f"page: {host}:{port}: cannot listen: {error}") from None
        self._socket.setblocking(False)
        self._bridge.opened(SPECTATOR, SPECTATOR)
        ready = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve(ready)), name=THREAD, daemon=True)
        self._thread.start()
        ready.wait()

    def close(self) -> None:
        """Close every page and stop listening."""
        if self._thread is None:
            return
        assert self._loop is not None
        assert self._is_over is not None
        self._loop.call_soon_threadsafe(self._is_over.set)
        self._thread.join()
        self._thread = None
        self._bridge.closed(SPECTATOR)

    async def _serve(self, ready: threading.Event) -> None:
        self._loop, self._is_over = asyncio.get_running_loop(), asyncio.Event()
        records = Records(self._folder)
        hub = PageHub(self._bridge, self._live, self._loaded, records, _build(), self._cables)
        server = HTTPServer(self._application(hub, records), max_body_size=MOST, idle_connection_timeout=60.0)
        assert self._socket is not None
        server.add_socket(self._socket)
        beat = PeriodicCallback(hub.tick, 1e3 * PERIOD)
        beat.start()
        ready.set()
        try:
            await self._is_over.wait()
        finally:
            beat.stop()
            server.stop()
            await server.close_all_connections()

    def _application(self, hub: PageHub, records: Records) -> Application:
        ping = self._loaded.cell.plc.life_timeout / PINGS
        return Application(
            [
                ("/live", PageSocket, {"hub": hub, "bridge": self._bridge, "token": self.token}),
                (r"/runs/(\d{1,9})/(data|config)", RunData, {"records": records}),
                (rf"/runs/(\d{{1,9}})/({'|'.join(FILES)})", RunFile, {"records": records}),
                (r"/runs/\d{1,9}", Static, {"name": "run.html"}),
                (r"/([\w-]+\.(?:html|js|css|svg))", Static),
                ("/", Static, {"name": "index.html"}),
            ],
            default_handler_class=Nothing,
            websocket_ping_interval=ping,
            websocket_ping_timeout=ping,
            websocket_max_message_size=MOST,
            log_function=lambda handler: None,
        )


class Guarded(RequestHandler):
    """Handler that answers only clients that reached the cell by a name of its own, and lets the browser load from here alone."""

    def prepare(self) -> None:
        """Refuse a foreign name.

        Raises:
            HTTPError: The name is foreign.
        """
        if not is_own_host(self.request.host):
            raise HTTPError(421, reason="not a name of this cell")
        for name, value in headers(self.request.host).items():
            self.set_header(name, value)

    def set_default_headers(self) -> None:
        """Send no header that names the server."""
        self.clear_header("Server")

    def write_error(self, status_code: int, **_: Any) -> None:
        """Answer one line of text."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code} {self._reason}\n")

    async def send(self, path: Path) -> None:
        """Answer a file, or the part of it that is asked for, as by a browser that seeks in a film, piece by piece."""
        size = path.stat().st_size
        first, last = part_of(self.request.headers.get("Range", ""), size)
        self.set_header("Content-Type", KINDS[path.suffix])
        self.set_header("Accept-Ranges", "bytes")
        self.set_header("Content-Length", str(last - first + 1))
        if last - first + 1 < size:
            self.set_status(206)
            self.set_header("Content-Range", f"bytes {first}-{last}/{size}")
        with path.open("rb") as file:
            file.seek(first)
            left = last - first + 1
            while left and (piece := file.read(min(PIECE, left))):
                left -= len(piece)
                self.write(piece)
                await self.flush()


class Static(Guarded):
    """Handler of the page's own files."""

    def initialize(self, name: str = "") -> None:
        """Take the file's name, where the address does not have it."""
        self._name = name

    async def get(self, name: str = "") -> None:
        """Answer the file."""
        path = STATIC / (self._name or name)
        if not path.is_file():
            raise HTTPError(404, reason="no such file")
        await self.send(path)


class RunData(Guarded):
    """Handler of one run as the journal has it, or of the config that it was made with."""

    def initialize(self, records: Records) -> None:
        """Take the records."""
        self._records = records

    def get(self, number: str, what: str) -> None:
        """Answer the run as JSON."""
        run = int(number)
        try:
            text = json.dumps(self._records.whole(run)) if what == "data" else self._records.config(run)
        except JournalError as error:
            raise HTTPError(404, reason=_ascii(error)) from None
        if text is None:
            raise HTTPError(404, reason=f"run {run}: its config was not kept")
        self.set_header("Content-Type", "application/json")
        self.finish(text if what == "data" else json.dumps(json.loads(text), indent=2))  # a person reads it


class RunFile(Guarded):
    """Handler of a file made of a run."""

    def initialize(self, records: Records) -> None:
        """Take the records."""
        self._records = records

    async def get(self, number: str, name: str) -> None:
        """Answer the file, which is made first where it is missing; a film takes minutes, for which nobody can wait."""
        run = int(number)
        try:
            path = self._records.film(run) if name == FILM else await self._records.file(run, name)
        except JournalError as error:
            raise HTTPError(404, reason=_ascii(error)) from None
        if path is None and name == FILM:
            self.set_status(202)
            self.finish("being drawn\n")
            return
        if path is None:
            raise HTTPError(404, reason=f"cell {FILES[name]} {run} cannot make it here")
        await self.send(path)


class Nothing(Guarded):
    """Handler of every other address."""

    def prepare(self) -> None:
        """Answer 404, because no page has this address.

        Raises:
            HTTPError: Always.
        """
        super().prepare()
        raise HTTPError(404, reason="no such page")


def _ascii(error: CellError) -> str:
    return str(error).encode("ascii", "replace").decode()


def _build() -> str:
    """Return a fingerprint of the page's own files."""
    digest = hashlib.sha256()
    for file in sorted(STATIC.iterdir()):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
