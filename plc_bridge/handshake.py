"""The sequence-number handshake of all buses: pure, no sockets, no threads, time passed in.

Links come and go; what may run is decided here, once for all buses, with the help of

    | module             | what it decides                                                   |
    | ------------------ | ----------------------------------------------------------------- |
    | `sequence_numbers` | which number is adopted, is a command, is late, changes nothing    |
    | `coils`            | which write of a coil is a command                                 |
    | `refusals`         | what is refused without asking the scan thread                     |
    | `intake`           | what of that becomes an order, and what a refusal                  |
    | `orders`           | in which order commands reach the scan thread                      |
    | `dispatch`         | what became of each: decided, ended, acknowledged                  |
    | `links`            | how an order ended, and whose answer and result a link reads       |
    | `answers`          | what its report and its inputs say of them                         |
    | `lease`            | who may start                                                      |
    | `watchdog`         | whether a link is alive, and its block whole                       |

Answers
    Every number gets one: `answered` with `refusal`, once the command was refused or the scan thread has decided.
    `sequence` and `result` tell how the link's own last command ended and are held until it is acknowledged or the
    next command comes; another's run never shows in them. A link that never wrote sees the run of whoever runs.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count

from plc_bridge.answers import Answer, Inputs, answer_for, inputs_for
from plc_bridge.dispatch import Counts, Dispatch
from plc_bridge.images import CommandImage
from plc_bridge.intake import Intake, goes_on, repeats
from plc_bridge.lease import CellLease
from plc_bridge.links import Link, Order
from plc_bridge.messages import Command, Control, Refusal, Report
from plc_bridge.packml import PackTags
from plc_bridge.peer_log import PeerLog
from plc_bridge.refusals import Rules
from plc_bridge.registers import Lease, Parameter
from plc_bridge.sight import PlcSight, sight_of
from plc_bridge.watchdog import LinkWatchdog

logger = logging.getLogger(__name__)


@dataclass(slots=True)
class Handshake:
    """Commands in from any number of links, at most one run at a time out, the right answer back to each.

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
    _links: dict[str, Link] = field(default_factory=dict)
    _events: "count[int]" = field(default_factory=count)
    """Number of links opened and closed so far."""
    _lease: CellLease = field(init=False)
    _dispatch: Dispatch = field(init=False)
    _intake: Intake = field(init=False)

    def __post_init__(self) -> None:
        self._lease = CellLease(self.lease_timeout, self.log)
        self._dispatch = Dispatch(self._lease, self.log)
        self._intake = Intake(Rules(self.programs, self.parameters), self._lease, self._dispatch, self._links)

    # Links.

    def opened(self, source: str, host: str, now: float, is_local: bool = False) -> None:
        """Begin a link; a local one is never silent."""
        self._links[source] = Link(source, host, LinkWatchdog(now), is_local, next(self._events))

    def closed(self, source: str) -> None:
        """End a link; what it holds and runs stays until its host comes back or the time-outs pass."""
        link = self._links.pop(source, None)
        if link is not None:
            link.closed = next(self._events)

    def lost(self, source: str) -> None:
        """Take `source` for lost, whatever its life counter says: its run stops, and its next number is adopted."""
        link, run = self._links[source], self._dispatch.run
        _forget(link)
        self._lease.release(link)
        if run is not None and run.link is link and _is_watched(run):
            self._lose(run, link, "its bus says so")

    def heard(self, source: str, now: float) -> None:
        """Note that any request came from `source`."""
        self._links[source].watchdog.heard = now

    # Writes of links.

    def wrote(self, source: str, image: CommandImage, now: float, is_numbered: bool = True) -> None:
        """Take the command block as it stands after a write of `source`; it counts once its number was written."""
        self._expire(now)
        link = self._links[source]
        link.has_spoken = True
        before, link.image = link.image, image
        if not link.watchdog.see(image.life, image.life_tail, now):
            self._intake.take_torn(link, image)
            return
        if is_numbered and link.numbers.must_adopt:
            self._resume(link, image)
        self._update_lease(link, image.lease)
        if image.acknowledge != (before.acknowledge if before else 0):
            self._acknowledge(link, image.acknowledge)
        if is_numbered:
            self._intake.take_number(link, image, now, before.code if before else Control.NONE)

    def switched(self, source: str, coils: Mapping[str, bool], now: float) -> None:
        """Take the coils that `source` has just written: execute, stop, reset."""
        self._expire(now)
        link = self._links[source]
        link.watchdog.heard = now
        self._intake.take_coils(link, coils, now)

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
        """Free the lease if `source` holds it."""
        self._lease.release(self._links[source])

    # Calls of the scan thread.

    def poll(self, now: float) -> Command | None:
        """Return the next thing for the scan thread to do, each once, stops first and the rest as it came.

        A command that the scan thread has neither accepted nor refused by now ended in a fault.
        """
        self._expire(now)
        return self._dispatch.poll()

    def accept(self, command: Command) -> None:
        """Take note that `command`, which the scan thread was given last, is done: a program begins, a control is obeyed."""
        self._dispatch.accept(command)

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Take note that `command`, which the scan thread was given last, is not done."""
        self._dispatch.refused(command, refusal)

    def publish(self, report: Report) -> None:
        """Take the scan thread's report; a result in it ends the run whose number it echoes."""
        self._dispatch.publish(report)

    # Reads of links.

    @property
    def counts(self) -> Counts:
        """Counts of what went wrong since the start."""
        return self._dispatch.counts

    @property
    def tags(self) -> PackTags:
        """PackTags of the cell."""
        return self._dispatch.tags

    @property
    def holder(self) -> str:
        """Name of the link that holds the lease; empty when it is free."""
        return self._lease.holder.source if self._lease.holder is not None else ""

    @property
    def kept(self) -> frozenset[str]:
        """The links that hold the lease or have a run under way: nobody takes their places."""
        holder, runner = self._lease.holder, self._lease.runner
        return frozenset(link.source for link in (holder, runner) if link is not None)

    @property
    def run(self) -> int:
        """Number in the journal of the run under way or last, whoever started it."""
        return self._dispatch.report.run

    @property
    def stops_held(self) -> int:
        """How many links hold their stop coil at 1."""
        return self._intake.stops_held

    @property
    def is_busy(self) -> bool:
        """Whether a program or skill was asked for and has not ended."""
        return self._dispatch.run is not None

    def answer(self, source: str) -> Answer:
        """Return the answer that `source` reads."""
        return answer_for(self._links[source], self._dispatch, self._lease)

    def inputs(self, source: str) -> Inputs:
        """Return the discrete inputs of `source`."""
        return inputs_for(self._links[source], self._dispatch, self._lease, self.stops_held)

    def sight(self, host: str, now: float) -> PlcSight | None:
        """Return what is seen of the PLC at `host`, an address, node or line; None while it is not there.

        Of several links of one host it is the one whose life counter changed most often.
        """
        return sight_of(self._links.values(), host, now)

    # Leases, results that were read, links that come back, and links that fall silent.

    def _update_lease(self, link: Link, wish: int) -> None:
        if wish in (Lease.TAKE, Lease.TAKE_FOR_HOST):
            self._lease.take(link)
        elif wish == Lease.RELEASE:
            self._lease.release(link)

    def _acknowledge(self, link: Link, sequence: int) -> None:
        if link.shown is not None and link.shown.sequence == sequence:
            self._dispatch.end(link.shown)

    def _resume(self, link: Link, image: CommandImage) -> None:
        """Let a link go on with the run of a closed link of its host.

        It writes the run's own number, or the one that the earlier link had come to, as after a hold; and nothing else.
        """
        link.has_resumed = False
        for order in (self._dispatch.run, self._dispatch.seen):
            earlier = order.link if order is not None else None
            if order is None or earlier is None or not link.follows(earlier):
                continue
            if not (repeats(image, order) or goes_on(image, earlier)):
                continue
            if image.code != Control.NONE and image.sequence == order.sequence:
                order.is_acknowledged = False  # whoever asks once more has not seen the answer
            self._lease.resume(earlier, link)
            if order is self._dispatch.run:
                link.watchdog.follow(earlier.watchdog)
                self._lease.runner = link
            link.resume(order)
            return

    def _expire(self, now: float) -> None:
        """Let time-outs act: lost runs, silent holders, blocks that stay torn."""
        run = self._dispatch.run
        link = run.link if run is not None and _is_watched(run) else None
        if run is not None and link is not None and link.watchdog.is_silent(now, self.life_timeout):
            self._lose(run, link, f"no sign of life for {self.life_timeout:g} s")
        self._lease.expire(now)
        for each in self._links.values():
            if each.watchdog.is_torn(now, self.life_timeout):
                each.watchdog.torn_since = None
                self._intake.refuse_torn(each)

    def _lose(self, run: Order, link: Link, why: str) -> None:
        self.log.warning(link.host, "%s is lost: %s", link.source, why)
        self.counts.lost += 1
        run.is_lost = True
        _forget(link)
        self._lease.release(link)
        self._dispatch.stop(Order(Command(run.sequence, Control.LOST, source=link.source), is_decided=True))


def _is_watched(run: Order) -> bool:
    """Tell whether a run stops when its link falls silent."""
    return run.link is not None and not run.is_lost and not run.link.is_local


def _forget(link: Link) -> None:
    """Let the link's next number be adopted, and its coils begin anew."""
    link.was_lost = True
    link.numbers.forget()
    link.coils.forget()
