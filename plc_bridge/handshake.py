"""The sequence-number handshake of all buses: pure, no sockets, no threads, time passed in.

Links come and go; what may run is decided here, once for all buses, with the help of

    | module             | what it decides                                                   |
    | ------------------ | ----------------------------------------------------------------- |
    | `sequence_numbers` | which number is adopted, is a command, is late, changes nothing    |
    | `coils`            | which write of a coil is a command                                 |
    | `refusals`         | what is refused without asking the scan thread                     |
    | `intake`           | what of all that becomes an order, and what a refusal              |
    | `orders`           | in which order commands reach the scan thread, and how each ended  |
    | `links`            | whose answer and result a link reads                               |
    | `answers`          | what its report and its inputs say of them                         |
    | `lease`            | who may start                                                      |
    | `watchdog`         | whether a link is alive, and its block whole                       |

Answers
    Every number gets one: `answered` with `refusal`, once the command was refused or the scan thread has decided.
    `sequence` and `result` tell how the link's own last command ended and are held until it is acknowledged or the
    next command comes; another's run never shows in them. A link that never wrote sees the run of whoever runs.
    An answer stays once it is given: the same block again, also after a loss, changes nothing.
Stops
    STOP, ABORT and the stop coil are obeyed from everybody, under every number and in every state. A block that is
    repeated unchanged is one stop; a coil is a level, which each connection holds for itself.
"""

import logging
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count

from plc_bridge.answers import Inputs, answer_for, inputs_for
from plc_bridge.images import CommandImage, ReportImage
from plc_bridge.intake import Intake
from plc_bridge.lease import CellLease
from plc_bridge.links import Link, Order
from plc_bridge.messages import Command, Control, Refusal
from plc_bridge.orders import Counts, Orders
from plc_bridge.peer_log import PeerLog
from plc_bridge.refusals import Rules
from plc_bridge.registers import Lease, Parameter
from plc_bridge.sight import PlcSight, sight_of
from plc_bridge.watchdog import LinkWatchdog

logger = logging.getLogger(__name__)


@dataclass(slots=True)
class Handshake:
    """Commands in from any number of links, at most one run at a time out, the right answer back to each.

    The scan thread calls `poll`, and `accept`, `refuse` and `publish` of `orders`.

    Args:
        programs: Name of each program and skill by its command code, from 100 on.
        parameters: Meaning of the numbered parameters.
        life_timeout: A run is lost when the life counter of its link stands still for this long, s. A link that
            never wrote its life counter shows life with any request.
        lease_timeout: Silence after which the lease is free again, s.
        log: Logger of refusals and of the lease's holders.
    """

    programs: Mapping[int, str]
    parameters: Sequence[Parameter] = ()
    life_timeout: float = 1.0
    lease_timeout: float = 5.0
    log: PeerLog = field(default_factory=lambda: PeerLog(logger))
    orders: Orders = field(init=False)
    _links: dict[str, Link] = field(default_factory=dict)
    _events: "count[int]" = field(default_factory=count)
    """Number of links opened and closed so far."""
    _lease: CellLease = field(init=False)
    _intake: Intake = field(init=False)

    def __post_init__(self) -> None:
        self._lease = CellLease(self.lease_timeout, self.log)
        self.orders = Orders(self._lease, self.log)
        self._intake = Intake(Rules(self.programs, self.parameters), self._lease, self.orders, self._links)

    # Links.

    def opened(self, source: str, host: str, now: float, is_local: bool = False) -> None:
        """Begin a link; a local one is never silent."""
        self._links[source] = Link(source, host, LinkWatchdog(now), is_local, next(self._events))

    def closed(self, source: str) -> None:
        """End a link; what it holds and runs stays until its host comes back or the time-outs pass."""
        link = self._links.pop(source, None)
        if link is not None:
            link.closed = next(self._events)

    def left(self, source: str, by: Hashable) -> None:
        """End a connection of a link that others share; the stop that it held falls."""
        link = self._links.get(source)
        if link is not None:
            link.leave(by)

    def lost(self, source: str) -> None:
        """Take `source` for lost, whatever its life counter says: its run stops, and its next number is adopted."""
        link, run = self._links[source], self.orders.run
        link.forget()
        self._lease.lose(link)
        if run is not None and run.link is link and run.is_watched:
            self._lose(run, link, "its bus says so")

    def heard(self, source: str, now: float) -> None:
        """Note that any request came from `source`."""
        self._links[source].watchdog.heard = now

    # Writes of links.

    def wrote(
        self, source: str, image: CommandImage, now: float, is_numbered: bool = True, by: Hashable = None
    ) -> None:
        """Take the command block as it stands after a write of `source`; it counts once its number was written.

        Args:
            source: The link.
            image: The whole block.
            now: Monotonic time, s.
            is_numbered: Whether its number has ever been written.
            by: Connection that has just written the number; None where nobody has, or nobody shares the link.
        """
        self._expire(now)
        link = self._links[source]
        link.has_spoken = True
        before, link.image = link.image, image
        if not link.watchdog.see(image.life, image.life_tail, now):
            self._intake.take_torn(link, image)
            return
        if by is not None:
            link.turn_to(by)
        if is_numbered and link.numbers.must_adopt:
            self._resume(link, image)
        if image.lease in (Lease.TAKE, Lease.TAKE_FOR_HOST):
            self._lease.take(link)
        elif image.lease == Lease.RELEASE:
            self._lease.release(link)
        if image.acknowledge != (before.acknowledge if before else 0):
            self._acknowledge(link, image.acknowledge)
        if is_numbered:
            self._intake.take_number(link, image, now, before.code if before else Control.NONE)

    def switched(self, source: str, coils: Mapping[str, bool], now: float, by: Hashable = None) -> None:
        """Take the coils that `source` has just written: execute, stop, reset; `by` names the connection, where several share the link."""
        self._expire(now)
        link = self._links[source]
        link.watchdog.heard = now
        self._intake.take_coils(link, coils, by, now)

    def submit(self, source: str, image: CommandImage, now: float) -> Refusal:
        """Submit an order of a local user under the next number of `source`; return why it was refused, if it was."""
        self._expire(now)
        link = self._links[source]
        link.has_spoken, link.image = True, image
        return self._intake.command(link, link.numbers.count_up(), image, now).refusal

    def take(self, source: str) -> bool:
        """Give `source` the lease if it is free; return whether it holds it now."""
        return self._lease.take(self._links[source])

    def release(self, source: str) -> None:
        """Free the lease if `source` holds it, at the end of its run."""
        self._lease.release(self._links[source])

    def poll(self, now: float) -> Command | None:
        """Return the next thing for the scan thread to do, each once, stops first and the rest as it came."""
        self._expire(now)
        return self.orders.next()

    # Reads of links.

    @property
    def counts(self) -> Counts:
        """Counts of what went wrong since the start."""
        return self.orders.counts

    @property
    def holder(self) -> str:
        """Name of the link that holds the lease; empty when it is free."""
        return self._lease.name

    @property
    def kept(self) -> frozenset[str]:
        """The links that hold the lease or have a run under way: nobody takes their places."""
        holder, runner = self._lease.holder, self._lease.runner
        return frozenset(link.source for link in (holder, runner) if link is not None)

    @property
    def stops_held(self) -> int:
        """How many connections hold their stop coil at 1."""
        return self._intake.stops_held

    def answer(self, source: str, life: int = 0) -> ReportImage:
        """Return the report that `source` reads, with the life counter of the cell."""
        return answer_for(self._links[source], self.orders, self._lease, life)

    def inputs(self, source: str) -> Inputs:
        """Return the discrete inputs of `source`."""
        return inputs_for(self._links[source], self.orders, self._lease, self.stops_held)

    def sight(self, host: str, now: float) -> PlcSight | None:
        """Return what is seen of the PLC at `host`, an address, node or line; None while it is not there.

        Of several links of one host it is the one whose life counter changed most often.
        """
        return sight_of(self._links.values(), host, now)

    # Results that were read, links that come back, and links that fall silent.

    def _acknowledge(self, link: Link, sequence: int) -> None:
        if link.shown is not None and link.shown.sequence == sequence:
            self.orders.end(link.shown)

    def _resume(self, link: Link, image: CommandImage) -> None:
        """Let a link go on with the run of a closed link of its host.

        It writes the run's own number, or the one that the earlier link had come to, as after a hold; and nothing else.
        """
        link.has_resumed = False
        for order in (self.orders.run, self.orders.seen):
            earlier = order.link if order is not None else None
            if order is None or earlier is None or not (link.follows(earlier) and earlier.gave(order)):
                continue
            if not (order.repeats(image) or _goes_on(image, earlier)):
                continue
            if image.code != Control.NONE and image.sequence == order.sequence:
                order.is_acknowledged = False  # whoever asks once more has not seen the answer
            self._lease.resume(earlier, link)
            if order is self.orders.run:
                link.watchdog.follow(earlier.watchdog)
                self._lease.runner = link
            link.resume(order)
            return

    def _expire(self, now: float) -> None:
        """Let time-outs act: lost runs, silent holders, blocks that stay torn."""
        run = self.orders.run
        link = run.link if run is not None and run.is_watched else None
        if run is not None and link is not None and link.watchdog.is_silent(now, self.life_timeout):
            self._lose(run, link, f"no sign of life for {self.life_timeout:g} s")
        self._lease.expire(now)
        for each in self._links.values():
            if each.watchdog.is_torn(now, self.life_timeout):
                self._intake.refuse_torn(each)

    def _lose(self, run: Order, link: Link, why: str) -> None:
        self.log.warning(link.host, "%s is lost: %s", link.source, why)
        self.counts.lost += 1
        run.is_lost = True
        link.forget()
        self._lease.lose(link)
        self.orders.stop(Order(Command(run.sequence, Control.LOST, source=link.source), is_decided=True))


def _goes_on(image: CommandImage, earlier: Link) -> bool:
    """Tell whether a block has the number that an earlier link had come to, and either its command once more or none at all."""
    stood = earlier.image
    is_known = stood is not None and image.sequence == earlier.numbers.last == stood.sequence
    return is_known and stood is not None and image.asked in (None, stood.asked)
