"""One open page as a link of the cell: its requests go into the same mailbox as a PLC's commands."""

import json
import logging
from asyncio import Future
from itertools import count
from typing import Any

from tornado.ioloop import IOLoop
from tornado.iostream import StreamClosedError
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from cell.page import telling
from cell.page.commands import Ask, BadAskError, parse
from cell.page.front import OPEN_LINE
from cell.page.guard import is_private
from cell.page.hub import PageHub
from cell.page.token import is_token
from cell.run.live import CablePull
from plc_bridge.bridge import Bridge
from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.messages import FIRST_PROGRAM, Result

logger = logging.getLogger(__name__)

PATIENCE = 3.0
"""Time within which a page that found no place must send the token, s."""
TRIES = 5
"""Number of wrong tokens after which a page is closed."""
_NUMBERS = count(1)
"""Numbers of the pages that have sent the token."""
BEHIND = 256 * 1024
"""Largest number of unsent bytes of a page; above this number the server closes the page, which can reconnect."""


class PageSocket(WebSocketHandler):
    """Sends the view to one page, and forwards the page's requests after the page has sent the token."""

    def initialize(self, hub: PageHub, bridge: Bridge, token: str) -> None:
        """Keep the parts shared by all pages."""
        self._hub, self._bridge, self._token = hub, bridge, token
        self._source = ""
        """Name of the page's link; empty until the page has sent the token."""
        self._tries = 0
        self._waiting = 0
        """Number of bytes queued and not yet sent."""
        self._has_missed = False
        self._own: dict[str, object] = {}

    @property
    def is_unlocked(self) -> bool:
        """True if the page has sent the token."""
        return bool(self._source)

    @property
    def peer(self) -> str:
        """Address of the page's computer."""
        return str(self.request.remote_ip)

    def open(self, *_: str, **__: str) -> None:
        """Admit the page; if there is no place, wait for its token, because a page with the token replaces one without."""
        self.set_nodelay(True)
        if why := self._hub.full(self):
            self._say("full", why=why)
            IOLoop.current().call_later(PATIENCE, self._leave_if_unknown, why)
        else:
            self._hub.greet(self)

    def _leave_if_unknown(self, why: str) -> None:
        if self not in self._hub.pages:
            self.leave(why)

    def leave(self, why: str) -> None:
        """Close this page; it can reconnect later."""
        self.close(1013, why)

    def on_message(self, message: str | bytes) -> None:
        """Execute the page's request, or send the reason of a refusal."""
        try:
            ask = parse(message)
        except BadAskError as error:
            self._say("refused", why=str(error))
            return
        if ask.token is not None:
            self._unlock(ask.token)
        elif not self._source:
            self._say("refused", why="this page may only look; show the token first")
        elif ask.cable is not None:
            if why := self._hub.pull(CablePull(ask.cable, ask.is_out, self._source)):
                self._say("refused", why=why)
        else:
            self._pass_on(ask)

    def on_pong(self, data: bytes) -> None:
        """Count the answer to a ping as a sign of life for this page's run; it does not extend the lease."""
        if not self._source:
            return
        report = self._bridge.report_for(self._source)
        if report.code >= FIRST_PROGRAM and report.result == Result.NONE:
            self._bridge.heard(self._source)

    def on_close(self) -> None:
        """End the link; a run that it started stops, as after a timeout of the PLC."""
        self._hub.leave(self)
        if self._source:
            self._bridge.closed(self._source)
            self._source = ""

    # Calls of the hub.

    def tell(self, text: bytes) -> None:
        """Send a text that must not be skipped; if too many bytes are unsent, close the page instead."""
        if self._waiting > BEHIND:
            self.close(1013, "too slow")
            return
        try:
            sent = self.write_message(text)
        except WebSocketClosedError:
            return
        self._waiting += len(text)

        def done(future: "Future[Any]") -> None:
            self._waiting -= len(text)
            error = future.exception()
            if error is not None and not isinstance(error, WebSocketClosedError | StreamClosedError):
                logger.debug("page: %s", error)

        sent.add_done_callback(done)

    def show(self, text: bytes) -> None:
        """Send a text, or skip it while an earlier one is unsent; after a skip, send the whole history instead."""
        stream = self.ws_connection.stream if self.ws_connection else None
        if stream is not None and stream.writing():  # the kernel's buffer is full
            self._has_missed = True
        elif self._has_missed:
            self._has_missed = False
            self.tell(self._hub.history())
        else:
            self.tell(text)

    def look(self) -> None:
        """Send changes of the page's lease and of its last command."""
        if self._source:
            own = telling.own(self._bridge.report_for(self._source))
            if own != self._own:
                self._own = own
                self._say("own", **own)

    # Requests of the page.

    def _unlock(self, token: str) -> None:
        if not is_private(self.request.protocol, self.peer):
            self._say("locked", why=OPEN_LINE)
        elif not is_token(token, self._token):
            self._tries += 1
            logger.warning("page: %s showed a wrong token", self.peer)
            self._say("locked", why="this is not the token of this cell")
            if self._tries >= TRIES:
                self.close(1008, "wrong token")
        elif self in self._hub.pages or self._hub.admit(self):
            if not self._source:
                self._source = f"page {self.peer} no. {next(_NUMBERS)}"
                self._bridge.opened(self._source, f"page {self.peer}")
            self._say("unlocked", source=self._source)

    def _pass_on(self, ask: Ask) -> None:
        self._bridge.heard(self._source)
        if ask.command is None:
            self._bridge.wrote(self._source, CommandImage(lease=ask.lease), is_numbered=False)
        else:
            self._bridge.submit(self._source, ask.command)

    def _say(self, kind: str, **data: object) -> None:
        self.tell(json.dumps({"kind": kind, **data}).encode())
