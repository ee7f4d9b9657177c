"""One open page as one more link of the cell: its requests go into the same mailbox as a PLC's commands."""

import json
import logging
from asyncio import Future
from typing import Any

from tornado.ioloop import IOLoop
from tornado.iostream import StreamClosedError
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from cell.live import Pull
from cell.page import telling
from cell.page.commands import Ask, BadAskError, parse
from cell.page.front import OPEN_LINE
from cell.page.guard import is_private
from cell.page.hub import PageHub
from cell.page.token import is_token
from plc_bridge.bridge import Bridge
from plc_bridge.images import CommandImage
from plc_bridge.messages import FIRST_PROGRAM, Result

logger = logging.getLogger(__name__)

PATIENCE = 3.0
"""Time for which a page that has no place may still show the token, s."""
TRIES = 5
"""Number of wrong tokens after which a page is closed."""
BEHIND = 256 * 1024
"""Number of bytes that may wait for a page that does not read; beyond it the page is closed and may come back."""


class PageSocket(WebSocketHandler):
    """Sends one page its view, and passes on its requests once it has shown the token."""

    def initialize(self, hub: PageHub, bridge: Bridge, token: str) -> None:
        """Take what all pages share."""
        self._hub, self._bridge, self._token = hub, bridge, token
        self._source = ""
        """Name of its link; empty as long as it may only look."""
        self._tries = 0
        self._waiting = 0
        """Number of bytes that have been sent and are not out yet."""
        self._has_missed = False
        self._own: dict[str, object] = {}

    @property
    def is_unlocked(self) -> bool:
        """True if the page has shown the token."""
        return bool(self._source)

    @property
    def peer(self) -> str:
        """Address of the page's computer."""
        return str(self.request.remote_ip)

    def open(self, *_: str, **__: str) -> None:
        """Greet the page; if there is no place, it may still show the token, for which a page without one leaves."""
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
        """Close this page, which may come again later."""
        self.close(1013, why)

    def on_message(self, message: str | bytes) -> None:
        """Do what the page asks for, or send it the reason why not."""
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
            self._pull(ask)
        else:
            self._pass_on(ask)

    def on_pong(self, data: bytes) -> None:
        """Take the answer to a ping as a sign of life for the run of this page; the lease alone it does not keep."""
        if self._source and self._is_running():
            self._bridge.heard(self._source)

    def on_close(self) -> None:
        """End the link; what it runs stops as that of a PLC that falls silent."""
        self._hub.leave(self)
        if self._source:
            self._bridge.closed(self._source)
            self._source = ""

    # Calls of the hub.

    def tell(self, text: bytes) -> None:
        """Send a text that later ones do not replace; a page too far behind is closed."""
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
        """Send a text that the page misses while an earlier one still waits; later it gets the whole history instead."""
        if self._waiting:
            self._has_missed = True
        elif self._has_missed:
            self._has_missed = False
            self.tell(self._hub.history())
        else:
            self.tell(text)

    def look(self) -> None:
        """Tell the page about its lease and its last command, where that has changed."""
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
                self._source = f"page {self.peer} {id(self) & 0xFFFF:04x}"
                self._bridge.opened(self._source, f"page {self.peer}")
            self._say("unlocked", source=self._source)

    def _pull(self, ask: Ask) -> None:
        assert ask.cable is not None
        if why := self._hub.pull(Pull(ask.cable, ask.is_out, self._source)):
            self._say("refused", why=why)

    def _pass_on(self, ask: Ask) -> None:
        self._bridge.heard(self._source)
        if ask.command is None:
            self._bridge.wrote(self._source, CommandImage(lease=ask.lease), is_numbered=False)
        else:
            self._bridge.submit(self._source, ask.command)

    def _is_running(self) -> bool:
        report = self._bridge.report_for(self._source)
        return report.code >= FIRST_PROGRAM and report.result == Result.NONE

    def _say(self, kind: str, **data: object) -> None:
        self.tell(json.dumps({"kind": kind, **data}).encode())
