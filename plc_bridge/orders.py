"""The one queue: every order from its write to its acknowledgement, to the scan thread and back; pure.

An order is decided once it was refused or carried out or, if it is a program, begun; its result comes with its end.
"""

import logging
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from plc_bridge.lease import CellLease
from plc_bridge.links import Order
from plc_bridge.messages import FIRST_PROGRAM, REMEDIES, UNNUMBERED, Command, Control, Refusal, Report, Result
from plc_bridge.packml import PackTags
from plc_bridge.peer_log import PeerLog

logger = logging.getLogger(__name__)

MOST_WAITING = 8
"""Largest number of orders that wait for the scan thread, without stops."""
MOST_ENDED = 16
"""Largest number of ended programs that are kept for their reader."""


@dataclass(slots=True)
class Counts:
    """Counts of errors since the start."""

    refusals: int = 0
    torn: int = 0
    lost: int = 0


@dataclass(slots=True)
class Orders:
    """The queue: first in, first out. Stops precede all other orders and drop those that wait.

    Args:
        lease: The lease of the cell; the queue sets the link of its run.
        log: Logger of refusals.
    """

    lease: CellLease
    log: PeerLog = field(default_factory=lambda: PeerLog(logger))
    counts: Counts = field(default_factory=Counts)
    tags: PackTags = field(default_factory=PackTags)
    run: Order | None = None
    """Program that waits for the scan thread or is under way."""
    seen: Order | None = None
    """Program that the scan thread began last."""
    latest: Order | None = None
    """Order of any link that was decided last."""
    report: Report = field(default_factory=Report)
    """Report that the scan thread published last."""
    ended: deque[Order] = field(default_factory=lambda: deque(maxlen=MOST_ENDED))
    """Programs that have ended, for a reader that takes them from here."""
    _waiting: deque[Order] = field(default_factory=deque)
    _stops: dict[int, list[Order]] = field(default_factory=dict)
    _given: Sequence[Order] = ()
    """Orders given to the scan thread last, all for one command."""

    # Calls of the scan thread.

    def next(self) -> Command | None:
        """Return the next command for the scan thread, each once, stops first and the rest in order of arrival.

        If the scan thread has neither accepted nor refused the previous command, that command ended in a fault.
        """
        for order in self._given:
            if not order.is_decided:
                self.decide(order, Result.FAULT)
        if self._stops:
            self._given = self._stops.pop(max(self._stops))
        else:
            self._given = (self._waiting.popleft(),) if self._waiting else ()
        return self._given[0].command if self._given else None

    def accept(self, command: Command) -> None:
        """Record that the scan thread carries out `command`, its last one: a program begins, or a control is done."""
        for order in self._undecided(command):
            if order.is_program:
                self.seen = order
            self.tags.obey(Control.START if order.is_program else order.command.code)
            self.decide(order, Result.NONE if order.is_program else Result.SUCCESS)

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Record that the scan thread refuses `command`, its last one."""
        for order in self._undecided(command):
            self.turn_down(order, refusal)

    def publish(self, report: Report) -> None:
        """Take the scan thread's report; a result in it ends the run whose number it echoes."""
        self.report = report
        run = self.run
        if run is None or not run.is_decided or report.sequence != run.sequence:
            return
        run.report = report
        if report.result is not Result.NONE:
            if run.command.code == FIRST_PROGRAM:
                self.tags.count(report.result)
            self.decide(run, report.result)

    def _undecided(self, command: Command) -> Sequence[Order]:
        """Return the orders of `command` that the scan thread has not decided yet."""
        is_given = bool(self._given) and self._given[0].command is command
        return [order for order in self._given if not order.is_decided] if is_given else []

    # Decisions on orders.

    @property
    def is_full(self) -> bool:
        """True if no more orders may wait for the scan thread."""
        return len(self._waiting) >= MOST_WAITING

    def add(self, order: Order) -> None:
        """Append an order; a program becomes the run."""
        self._waiting.append(order)
        if order.is_program:
            self.run, self.lease.runner = order, order.link

    def stop(self, order: Order) -> None:
        """Put a stop in front and drop the waiting orders."""
        dropped = tuple(self._waiting)
        self._waiting.clear()
        self._stops.setdefault(order.command.code, []).append(order)
        for each in dropped:
            if not each.is_decided:
                self.decide(each, Result.ABORTED)

    def decide(self, order: Order, result: Result = Result.NONE, refusal: Refusal = Refusal.NONE) -> None:
        """Record the decision on an order."""
        order.is_decided, order.result, order.refusal = True, result, refusal
        if order.link is not None:
            order.link.told = refusal
        if order.sequence != UNNUMBERED and order.command.code < Control.LOST:
            self.latest = order
        if order is self.run and result is not Result.NONE:
            self.run = None
            self.ended.append(order)
            self.lease.end_run()

    def turn_down(self, order: Order, refusal: Refusal) -> None:
        """Answer an order with a refusal; equal refusals in a row give one line in the log."""
        self.counts.refusals += 1
        what = "control" if order.sequence == UNNUMBERED else f"command {order.sequence}"
        link = order.link
        if link is None or link.told is not refusal:
            host = link.host if link is not None else order.command.source
            self.log.warning(
                host, "%s: %s refused: %s: %s", order.command.source, what, refusal.name, REMEDIES[refusal]
            )
        self.decide(order, Result.REFUSED, refusal)

    def end(self, order: Order) -> None:
        """Mark the result of `order` as read; the cell may leave its state COMPLETE."""
        if order.is_acknowledged or order.result is Result.NONE:
            return
        order.is_acknowledged = True
        if order is self.seen:
            told = Command(order.sequence, Control.ACKNOWLEDGE, source=order.command.source)
            self.add(Order(told, is_decided=True))
