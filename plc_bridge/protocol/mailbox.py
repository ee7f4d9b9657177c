"""The mailbox between the scan thread and the servers: the only connection of the threads.

One lock guards the handshake; every method holds it for a few microseconds and waits for nothing else.
"""

import logging
import math
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import ParamSpec, TypeVar

from plc_bridge.config import PlcConfig
from plc_bridge.protocol.handshake import Handshake
from plc_bridge.protocol.images import DIAGNOSTICS, PACKML, REPORT
from plc_bridge.protocol.intervals import Intervals
from plc_bridge.protocol.links import Order
from plc_bridge.protocol.messages import Diagnostics, Refusal, Report
from plc_bridge.protocol.peer_log import PeerLog
from plc_bridge.protocol.registers import DISCRETE_INPUTS, Parameter

P = ParamSpec("P")
T = TypeVar("T")


class Mailbox:
    """Commands for the scan thread and reports for all readers; servers write and read through it.

    Args:
        config: The time-outs.
        programs: Name of each program and skill by its command code, from 100 on.
        parameters: Meaning of the numbered parameters, at most eight.
        now: Monotonic time, s.
    """

    def __init__(
        self, config: PlcConfig, programs: Mapping[int, str], parameters: Sequence[Parameter], now: Callable[[], float]
    ) -> None:
        self._now = now
        self._lock = threading.Lock()
        self._handshake = Handshake(
            dict(programs),
            tuple(parameters),
            config.life_timeout,
            config.lease_timeout,
            PeerLog(logging.getLogger("plc_bridge.protocol.handshake"), now),
            now,
        )
        self._life = 0
        self._published = -math.inf
        self._intervals = Intervals()
        # Calls of the scan thread, which must accept or refuse a command before its next `poll`.
        self.poll = self._locked(self._handshake.poll)
        self.accept = self._locked(self._handshake.orders.accept)
        self.refuse = self._locked(self._handshake.orders.refuse)
        # Calls of the servers.
        self.opened = self._locked(self._handshake.opened)
        self.closed = self._locked(self._handshake.closed)
        self.left = self._locked(self._handshake.left)
        self.lost = self._locked(self._handshake.lost)
        self.heard = self._locked(self._handshake.heard)
        self.wrote = self._locked(self._handshake.wrote)
        self.switched = self._locked(self._handshake.switched)
        self.control = self._locked(self._handshake.control)
        self.acknowledge = self._locked(self._handshake.acknowledge)
        # Calls of local users and of the commissioning.
        self.submit = self._locked(self._handshake.submit)
        self.sight = self._locked(self._handshake.sight)

    def _locked(self, call: Callable[P, T]) -> Callable[P, T]:
        """Return a call of the handshake that holds the lock."""

        def locked(*args: P.args, **kwargs: P.kwargs) -> T:
            with self._lock:
                return call(*args, **kwargs)

        return locked

    def publish(self, report: Report) -> None:
        """Publish `report` to all readers; a result in it ends the command whose sequence number it echoes."""
        with self._lock:
            self._life, self._published = (self._life + 1) % 0x10000, self._now()
            self._handshake.orders.publish(report)
            self._intervals.note(self._published)
            self._handshake.orders.tags.record(report, self._published)

    @property
    def is_scanned(self) -> bool:
        """True if the newest report is recent."""
        with self._lock:
            # Age of the last report up to which the cell counts as scanned, s; ten periods of the slowest scan.
            return self._now() - self._published < 1.0

    @property
    def holder(self) -> str:
        """Name of the link that holds the lease; empty if it is free."""
        with self._lock:
            return self._handshake.holder

    @property
    def kept(self) -> frozenset[str]:
        """Links that hold the lease or have a run under way; they keep their places."""
        with self._lock:
            return self._handshake.kept

    @property
    def run(self) -> int:
        """Journal number of the run under way, else of the last one, for any link."""
        return self._handshake.orders.report.run

    @property
    def obstacle(self) -> Refusal:
        """Refusal that a program with a fresh peg would get now, from the state of peg, hole and rack."""
        return self._handshake.orders.report.obstacle

    @property
    def diagnostics(self) -> Diagnostics:
        """Counts since the start, without those of the servers."""
        with self._lock:
            return replace(self._handshake.counts, stops_held=self._handshake.orders.stops_held)

    def take(self, source: str) -> bool:
        """Give the lease to a user of this process, as "terminal"; return True if it was free."""
        with self._lock:
            self._handshake.opened(source, source, is_local=True)
            is_taken = self._handshake.take(source)
            if not is_taken:
                self._handshake.closed(source)
            return is_taken

    def release(self, source: str) -> None:
        """Return the lease of a local user."""
        with self._lock:
            self._handshake.release(source)
            self._handshake.closed(source)

    def ended(self) -> list[Order]:
        """Return the programs that have ended since the last call; for one reader."""
        with self._lock:
            ended = self._handshake.orders.ended
            orders = list(ended)
            ended.clear()
            return orders

    def report_for(self, source: str) -> Report:
        """Return the report for the link `source`, for a server."""
        with self._lock:
            return self._handshake.answer(source, self._life)

    def report_words(self, source: str) -> list[int]:
        """Return the report block for the link `source`, for a server."""
        return REPORT.words_of(self.report_for(source))

    def diagnostics_words(self) -> list[int]:
        """Return the diagnostics block, for a server."""
        return DIAGNOSTICS.words_of(self.diagnostics)

    def packml_words(self) -> list[int]:
        """Return the block of PackTags, for a server."""
        with self._lock:
            return PACKML.words_of(self._handshake.orders.tags)

    def discrete_inputs(self, source: str) -> list[bool]:
        """Return the discrete inputs, for a server."""
        with self._lock:
            inputs = self._handshake.inputs(source)
        return [getattr(inputs, name) for name in DISCRETE_INPUTS]
