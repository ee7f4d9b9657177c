"""The sequence-number handshake of all buses: pure, no sockets, no threads, its clock passed in.

Links open and close at any time. The handshake decides, in one way for all buses, if a command runs. It uses

    | module             | decision                                                      |
    | ------------------ | ------------------------------------------------------------- |
    | `sequence_numbers` | a number is adopted, is a command, is late, or has no effect  |
    | `orders`           | a number or a coil becomes an order, is refused, waits, ends  |
    | `links`            | the answer and the result that a link reads                   |
    | `lease`            | permission to start                                           |
    | `watchdog`         | a link is alive, and its block whole                          |

Answers
    Every number gets an answer, `answered` with `refusal`, as soon as the command is refused, begun or carried out.
    `sequence` and `result` give the result of the link's own last command, until the link acknowledges the result or
    sends its next command. Until a link first writes more than its stop coil, they show the run of any link; afterwards
    only its own. An answer never changes: if a link repeats its block, even after a loss, the answer remains.
Stops
    The cell obeys STOP, ABORT and the stop coil from every link, under every number and in every state. If a link
    repeats a block unchanged, the cell stops only once. The stop coil is a level; each connection has its own.
"""

import logging
import math
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count

from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.intervals import Intervals
from plc_bridge.protocol.lease import CellLease
from plc_bridge.protocol.links import Link, Order
from plc_bridge.protocol.messages import Command, Control, Diagnostics, Inputs, Refusal, Report, Result
from plc_bridge.protocol.orders import Orders
from plc_bridge.protocol.peer_log import PeerLog
from plc_bridge.protocol.registers import VERSION, Lease, Parameter
from plc_bridge.protocol.watchdog import LinkWatchdog, PlcSight

logger = logging.getLogger(__name__)

IDLE, COMPLETE = 4, 17
"""States of PackML in which a start is accepted."""
_NO_ORDER = Order(Command(0, Control.NONE))
_OF_A_RUN = ("stage", "reason", "progress", "run", "stage_times", "total_time", "peak_force", "hole")
"""Fields of the report that belong to a run; the others belong to the cell or to the link."""


@dataclass(slots=True)
class Handshake:
    """Takes commands from any number of links, passes on at most one run at a time, and returns to each link its own answer.

    The scan thread calls `poll` and `publish` once a scan, and accepts or refuses a command before the next `poll`.

    Args:
        programs: Name of each program and skill by its command code, from 100 on.
        parameters: Meaning of the numbered parameters.
        life_timeout: Longest time without a change of the life counter of a run's link, s; the run then counts as lost. If
            a link never wrote its life counter, any request is a sign of life.
        lease_timeout: Silence after which the lease is free again, s.
        now: Monotonic time, s.
    """

    programs: Mapping[int, str]
    parameters: Sequence[Parameter] = ()
    life_timeout: float = 1.0
    lease_timeout: float = 5.0
    now: Callable[[], float] = time.monotonic
    log: PeerLog = field(init=False)
    _lease: CellLease = field(init=False)
    _orders: Orders = field(init=False)
    _links: dict[str, Link] = field(init=False)
    _events: "count[int]" = field(init=False, default_factory=count)
    """Number of links opened and closed so far."""
    _intervals: Intervals = field(init=False, default_factory=Intervals)
    _life: int = field(init=False, default=0)
    _published: float = field(init=False, default=-math.inf)
    """Time of the last report, s."""

    def __post_init__(self) -> None:
        self.log = PeerLog(logger, self.now)
        self._lease = CellLease(self.lease_timeout, self.log)
        self._orders = Orders(self._lease, self.log, self.programs, self.parameters)
        self._links = self._orders.links

    # Calls of the scan thread.

    def poll(self) -> Command | None:
        """Return the next command for the scan thread, each command once: stops first, then in order of arrival."""
        self._expire()
        return self._orders.next()

    def accept(self, command: Command) -> None:
        """Record that the scan thread accepts `command`, the one polled last: a program has begun, or a control is done."""
        self._orders.accept(command)

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Record that the scan thread refuses `command`, the one polled last."""
        self._orders.refuse(command, refusal)

    def publish(self, report: Report) -> None:
        """Publish `report` to all readers; a result in the report ends the run that has the report's sequence number."""
        self._life, self._published = (self._life + 1) % 0x10000, self.now()
        self._orders.publish(report)
        self._orders.tags.record(report, self._published)
        self._intervals.note(self._published)

    # Links.

    def opened(self, source: str, host: str) -> None:
        """Begin a link."""
        self._links[source] = Link(source, host, LinkWatchdog(self.now()), next(self._events))

    def closed(self, source: str) -> None:
        """End a link; its lease and its run remain until its host opens a new link or the time-outs pass."""
        link = self._links.pop(source, None)
        if link is not None:
            link.closed = next(self._events)

    def left(self, source: str, by: Hashable) -> None:
        """End the connection `by` of a link, and release the stop that this connection holds."""
        link = self._links.get(source)
        if link is not None:
            link.leave(by)

    def lost(self, source: str) -> None:
        """Treat `source` as lost, regardless of its life counter: its run stops, and its next number is adopted."""
        link, run = self._links[source], self._orders.run
        link.forget()
        self._lease.lose(link)
        if run is not None and run.link is link and run.is_watched:
            self._lose(run, link, "reported by its bus")

    def heard(self, source: str) -> None:
        """Record a request of any kind from `source`."""
        self._links[source].watchdog.heard = self.now()

    # Writes of links.

    def wrote(self, source: str, image: CommandImage, is_numbered: bool = True, by: Hashable = None) -> None:
        """Take the command block that `source` has just written; the command counts only if the link wrote a number.

        Args:
            source: The link.
            image: The whole block.
            is_numbered: True if the link has ever written its sequence number.
            by: Connection that has just written the number; None without a new number, or if a link is one connection.
        """
        now, link = self._expire(), self._links[source]
        link.has_spoken = True
        if not link.watchdog.see(image.life, image.life_tail, now):
            self._orders.take_torn(link, image)
            return
        before, link.image, link.torn = link.image or CommandImage(), image, None
        if by is not None:
            link.turn_to(by)
        if is_numbered and link.numbers.must_adopt:
            self._resume(link, image)
        if image.lease in (Lease.TAKE, Lease.TAKE_FOR_HOST):
            self._lease.take(link)
        elif image.lease == Lease.RELEASE:
            self._lease.release(link)
        if image.acknowledge != before.acknowledge:
            self.acknowledge(source, image.acknowledge)
        if is_numbered:
            self._orders.take_number(link, image, before.code)

    def switched(self, source: str, coils: Mapping[str, bool], by: Hashable = None) -> None:
        """Take the coils that `source` has just written: execute, stop, reset; `by` is the connection that wrote them."""
        link = self._links[source]
        link.watchdog.heard = self._expire()
        self._orders.take_coils(link, coils, by)

    def submit(self, source: str, image: CommandImage) -> Refusal:
        """Submit an order of the local user `source`; its number is assigned here. Return its refusal, or NONE."""
        link = self._links[source]
        link.watchdog.heard, link.has_spoken, link.image = self._expire(), True, image
        return self._orders.command(link, link.numbers.give(), image).refusal

    def control(self, source: str, code: int) -> Order:
        """Take a control that `source` sends without a number; only the returned order holds the answer and the result."""
        self._expire()
        return self._orders.control(self._links[source], code)

    def acknowledge(self, source: str, sequence: int) -> None:
        """Take an acknowledgement from `source`; it counts if `sequence` is the number of the result that the link reads."""
        shown = self._links[source].shown
        if shown is not None and shown.sequence == sequence:
            self._orders.end(shown)

    # Reads.

    @property
    def diagnostics(self) -> Diagnostics:
        """Counts of errors since the start."""
        return replace(self._orders.counts, stops_held=self._orders.stops_held)

    @property
    def holder(self) -> str:
        """Name of the link that holds the lease; empty if it is free."""
        return self._lease.name

    @property
    def kept(self) -> frozenset[str]:
        """Links that hold the lease or have a run under way; they must not be closed to make room."""
        holder, runner = self._lease.holder, self._lease.runner
        return frozenset(link.source for link in (holder, runner) if link is not None)

    @property
    def is_scanned(self) -> bool:
        """True if the scan thread has published a report less than 1 s ago."""
        # Age of the last report up to which the cell counts as scanned, s; ten periods of the slowest scan.
        return self.now() - self._published < 1.0

    @property
    def run(self) -> int:
        """Journal number of the run under way, else of the last one, for any link."""
        return self._orders.report.run

    @property
    def obstacle(self) -> Refusal:
        """Refusal that a program with a fresh peg would get now, from the state of peg, hole and rack."""
        return self._orders.report.obstacle

    def ended(self) -> list[Order]:
        """Return the programs that have ended since the last call; only one reader may call it."""
        orders = list(self._orders.ended)
        self._orders.ended.clear()
        return orders

    def report_for(self, source: str) -> Report:
        """Return the report that `source` reads; no other function composes it.

        Until a link has written more than its stop coil, its report shows the run of any link. The fault of the link's
        own run stays with its result, also after another link has reset the cell.
        """
        link, orders = self._links[source], self._orders
        shown, answered = link.in_view, link.answered
        if not link.has_spoken:
            shown, answered = orders.run or orders.seen, orders.latest
        shown, answered = shown or _NO_ORDER, answered or _NO_ORDER
        result = shown.told_to(link)
        is_own_fault = result is Result.FAULT and shown.link is link
        return replace(
            orders.report,
            **{name: getattr(shown.report, name) for name in _OF_A_RUN},
            life=self._life,
            life_tail=self._life,
            version=VERSION,
            lease=self._lease.state_for(link),
            holder=self._lease.name,
            sequence=shown.sequence,
            result=result,
            fault=orders.report.fault or (shown.report.fault if is_own_fault else 0),
            code=shown.command.code,
            answered=answered.sequence,
            answered_result=answered.result,
            refusal=answered.refusal,
            refusal_detail=answered.detail,
        )

    def inputs(self, source: str) -> Inputs:
        """Return the discrete inputs of `source`.

        They show the last request by the execute coil, or the order of the last number if it is newer. If this order has
        nothing to show, they show the last request by the reset coil.
        """
        link, orders = self._links[source], self._orders
        order = link.requests.get("execute", link.in_view)
        if order is None or not order.is_shown:
            order = link.requests.get("reset", _NO_ORDER)
        result = order.told_to(link)
        is_waiting = orders.report.state in (IDLE, COMPLETE) and orders.report.obstacle is Refusal.NONE
        return Inputs(
            busy=order.is_under_way,
            done=order.is_program and result is Result.SUCCESS,
            error=result in (Result.FAILURE, Result.FAULT, Result.REFUSED),
            command_aborted=result is Result.ABORTED,
            ready=is_waiting and orders.run is None and not orders.stops_held and self._lease.is_open_to(link),
        )

    def sight(self, host: str) -> PlcSight | None:
        """Return the cell's view of the PLC at `host`, an address, node or line; None if no open link has written.

        If one host has several links, the view is of the link whose life counter changed most often.
        """
        spoken = [link for link in self._links.values() if link.host.rpartition("@")[2] == host and link.has_spoken]
        if not spoken:
            return None
        link = max(spoken, key=lambda each: each.watchdog.changes)
        version, watch = link.image.version if link.image is not None else 0, link.watchdog
        silence = watch.silence(self.now())
        return PlcSight(link.source, version, watch.changes, watch.longest_gap, silence, watch.uses_tail)

    # Resumed links and silent links.

    def _resume(self, link: Link, image: CommandImage) -> None:
        """Let a link continue the run of a closed link of its host."""
        link.has_resumed = False
        for order in filter(None, (self._orders.run, self._orders.seen)):
            earlier = order.link
            if earlier is None or not link.continues(order, image):
                continue
            if image.code != Control.NONE and image.sequence == order.sequence:
                order.is_acknowledged = False  # the request is repeated, so the PLC has not read the answer
            self._lease.resume(earlier, link)
            if order is self._orders.run:
                link.watchdog.follow(earlier.watchdog)
                self._lease.runner = link
            link.resume(order)
            return

    def _expire(self) -> float:
        """Apply the time-outs: lost runs, silent holders, permanently torn blocks; return the time, s."""
        now, run = self.now(), self._orders.run
        link = run.link if run is not None and run.is_watched else None
        if run is not None and link is not None and link.watchdog.silence(now) > self.life_timeout:
            self._lose(run, link, f"no sign of life for {self.life_timeout:g} s")
        self._lease.expire(now)
        for each in self._links.values():
            if each.watchdog.is_torn(now, self.life_timeout):
                self._orders.refuse_torn(each)
        return now

    def _lose(self, run: Order, link: Link, why: str) -> None:
        self.log.warning(link.host, "%s is lost: %s", link.source, why)
        self._orders.counts.lost += 1
        run.is_lost = True
        link.forget()
        self._lease.lose(link)
        self._orders.stop(Order(Command(run.sequence, Control.LOST, source=link.source), is_decided=True))
