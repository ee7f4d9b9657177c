"""Base of every HTTP server of a cell: one guard before all routes, and the serving thread."""

import asyncio
import logging
import socket as sockets
import ssl
import threading
from collections.abc import Callable, Collection
from concurrent.futures import Future
from functools import partial
from typing import Any, Self

from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPServerRequest
from tornado.web import Application, HTTPError, RequestHandler

from cell.page.commands import MOST
from cell.page.guard import headers, is_private, refusal
from cell.page.token import is_token
from cell.records.patient_log import SparseFilter
from drivers.errors import DeviceNotOpenedError

THREAD = "page"
"""Name of the serving threads."""
LOGGERS = (
    "tornado.access",
    "tornado.application",
    "tornado.general",
    "cell.page.front",
    "cell.page.server",
    "cell.page.socket",
)
"""Names of the loggers for requests of other computers."""
IDLE = 60.0
"""Time after which the server closes a connection, s: without a request, or without an acknowledgement of sent data."""


OPEN_LINE = "a token is taken only over https or from the cell's own computer"


class Guarded(RequestHandler):
    """Base of every handler: errors are one line of text, and headers restrict the browser to content from the cell."""

    is_answered = True
    """True if the request has passed the guard."""

    def set_default_headers(self) -> None:
        """Set the guard's headers, and remove the one that names the server."""
        self.clear_header("Server")
        for name, value in headers(self.request.host if self.is_answered else "").items():
            self.set_header(name, value)

    def require_token(self) -> None:
        """Require the token of the cell, in a header that a page of another site cannot send.

        Raises:
            HTTPError: The token is missing or wrong.
        """
        assert self.request.remote_ip is not None
        if not is_private(self.request.protocol, self.request.remote_ip):
            raise HTTPError(403, reason=OPEN_LINE)
        if not is_token(self.request.headers.get("Authorization", "").removeprefix("Bearer "), self.settings["token"]):
            raise HTTPError(401, reason="only with the token of this cell")

    def write_error(self, status_code: int, **_: Any) -> None:
        """Send the error as one line of text."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code} {self._reason}\n")


class Refused(Guarded):
    """Handler of refused requests."""

    is_answered = False

    def initialize(self, status: int, why: str) -> None:
        """Keep the status and the reason."""
        self._answer = HTTPError(status, reason=why)

    def prepare(self) -> None:
        """Refuse.

        Raises:
            HTTPError: Always.
        """
        raise self._answer


class Front(Application):
    """The routes of one server; every request passes the guard first, for any method and route."""

    def __init__(self, routes: list[Any], names: Collection[str], **settings: Any) -> None:
        """Keep the routes, and the names of the cell in addition to those of this computer."""
        nothing = {"status": 404, "why": "no such page"}
        settings |= {"default_handler_class": Refused, "default_handler_args": nothing}
        super().__init__(routes, log_function=lambda handler: None, **settings)
        self._names = frozenset(name.lower() for name in names)

    def find_handler(self, request: HTTPServerRequest, **kwargs: Any) -> Any:
        """Return the handler of a request's route, or the handler that refuses it."""
        if why := refusal(request.host, request.headers.get("Origin"), self._names):
            return self.get_handler_delegate(request, Refused, {"status": 421, "why": why})
        return super().find_handler(request, **kwargs)


class HttpServer:
    """One HTTP server on a separate thread with its own event loop.

    Constructing touches nothing. `start` opens the port; `close` is idempotent.

    Args:
        what: Option that starts this server, for messages.
        address: Host and port; port 0 takes a free one.
    """

    routes: Front
    """Routes of the server; a subclass sets them before `start`."""

    def __init__(self, what: str, address: tuple[str, int]) -> None:
        self._what, self._asked, self._sparse = what, address, SparseFilter()
        self._context: ssl.SSLContext | None = None
        self._socket: sockets.socket | None = None
        self._thread: threading.Thread | None = None

    @property
    def url(self) -> str:
        """Address of the server for a browser."""
        host, port = self.address
        scheme = "http" if self._context is None else "https"
        return f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}/"

    @property
    def address(self) -> tuple[str, int]:
        """Host and port that the server listens on."""
        assert self._socket is not None
        host, port = self._socket.getsockname()[:2]
        return host, port

    def start(self) -> None:
        """Listen.

        Raises:
            DeviceNotOpenedError: The port is in use, the address is not this computer's, or the keys cannot be used.
        """
        host, port = self._asked
        self._context = self.context()
        try:
            family = sockets.AF_INET6 if ":" in host else sockets.AF_INET
            self._socket = sockets.create_server((host, port), family=family)
        except (OSError, UnicodeError) as error:
            why = getattr(error, "strerror", None) or error
            raise DeviceNotOpenedError(
                f"{self._what} {host}:{port}: cannot listen: {why}; another port allowed"
            ) from None
        self._socket.setblocking(False)
        # Each connection inherits this. The browser's kernel acknowledges data, so that a busy browser stays connected.
        self._socket.setsockopt(sockets.IPPROTO_TCP, sockets.TCP_USER_TIMEOUT, round(1e3 * IDLE))
        for name in LOGGERS:
            logging.getLogger(name).addFilter(self._sparse)
        ready = Future[Callable[[], object]]()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve(ready)), name=THREAD, daemon=True)
        self._thread.start()
        self._end = ready.result()

    def close(self) -> None:
        """Close every connection and stop listening."""
        for name in LOGGERS:
            logging.getLogger(name).removeFilter(self._sparse)
        if self._thread is None:
            return
        self._end()
        self._thread.join()
        self._thread = None

    def __enter__(self) -> Self:
        """Start."""
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def context(self) -> ssl.SSLContext | None:
        """Return the TLS context; None to serve without TLS.

        Raises:
            DeviceNotOpenedError: The keys cannot be used.
        """
        return None

    async def work(self, is_over: asyncio.Event) -> None:
        """Run the server's periodic work until `is_over` is set."""
        await is_over.wait()

    async def _serve(self, ready: Future[Callable[[], object]]) -> None:
        """Serve until a thread calls the function that `ready` receives."""
        is_over = asyncio.Event()
        assert self._socket is not None
        server = HTTPServer(self.routes, max_body_size=MOST, idle_connection_timeout=IDLE, ssl_options=self._context)
        server.add_socket(self._socket)
        ready.set_result(partial(asyncio.get_running_loop().call_soon_threadsafe, is_over.set))
        try:
            await self.work(is_over)
        finally:
            server.stop()
            await server.close_all_connections()
