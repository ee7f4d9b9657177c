"""The sequence-number handshake of all buses: pure, no sockets, no threads, time passed in.

Links come and go; what may run is decided here, once for all buses, with the help of

    | module             | what it decides                                                   |
    | ------------------ | ----------------------------------------------------------------- |
    | `sequence_numbers` | which number is adopted, is a command, is late, changes nothing    |
    | `coils`            | which write of a coil is a command                                 |
    | `refusals`         | what is refused without asking the scan thread                     |
    | `orders`           | in which order commands reach the scan thread, and how each ended  |
    | `links`            | which order's answer and result a link reads                       |
    | `lease`            | who may start                                                      |
    | `watchdog`         | whether a link is alive, and its block whole                       |

Answers
    Every number gets one: `answered` with `refusal`, once the command was refused or the scan thread has decided.
    `sequence` and `result` tell how the link's own last command ended and are held until it is acknowledged or the
    next command comes; another's run never shows in them. A link that never wrote sees the run of whoever runs.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count

from plc_bridge.coils import Edge
from plc_bridge.images import CommandImage
from plc_bridge.lease import CellLease
from plc_bridge.links import Link
from plc_bridge.messages import FIRST_PROGRAM, UNNUMBERED, Command, Control, LeaseState, Refusal, Report, Result
from plc_bridge.orders import Order, Orders
from plc_bridge.packml import PackTags
from plc_bridge.peer_log import PeerLog
from plc_bridge.refusals import CONTROLS, STOPS, BadParameterError, Rules
from plc_bridge.registers import Lease, Parameter
from plc_bridge.sequence_numbers import Verdict
from plc_bridge.watchdog import Watchdog

logger = logging.getLogger(__name__)


IDLE, COMPLETE = 4, 17
"""States of PackML in which a start is taken."""
_ERRORS = (Result.FAILURE, Result.FAULT, Result.REFUSED)


@dataclass(frozen=True, slots=True)
class Answer:
    """What the report tells one link about its own command."""

    sequence: int
    result: Result
    answered: int
    refusal: Refusal
    refusal_detail: int
    answered_result: Result
    code: int
    is_busy: bool
    lease: LeaseState
    report: Report
    """The state of the cell as published last, with the details of the run that `sequence` belongs to."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """The discrete inputs of one link, by name; done, error and command_aborted are held until acknowledged."""

    busy: bool
    done: bool
    error: bool
    command_aborted: bool
    ready: bool
    """The one input that is held by nothing: a start of this link would be taken now."""


@dataclass(slots=True)
class Counts:
    """What went wrong since the start."""

    refusals: int = 0
    torn: int = 0
    lost: int = 0


@dataclass(slots=True)
class Handshake:
    """Commands in from any number of links, at most one run at a time out, the right answer back to each.

    Args:
        programs: Name of each program and skill by its command code, from 100 on.
        parameters: What the numbered parameters mean.
        life_timeout: A run is lost when the life counter of its link stands still for this long, s. A link that
            never wrote its life counter shows life with any request.
        lease_timeout: Silence after which the lease is free again, s.
        log: Where it is told what is refused, and who holds the lease.
    """

    programs: Mapping[int, str]
    parameters: Sequence[Parameter] = ()
    life_timeout: float = 1.0
    lease_timeout: float = 5.0
    counts: Counts = field(default_factory=Counts)
    log: PeerLog = field(default_factory=lambda: PeerLog(logger))
    tags: PackTags = field(default_factory=PackTags)
    _links: dict[str, Link] = field(default_factory=dict)
    _orders: Orders = field(default_factory=Orders)
    _given: Sequence[Order] = ()
    """Orders that the scan thread was given last, all of one command."""
    _run: Order | None = None
    """The program that waits for the scan thread or is under way."""
    _seen: Order | None = None
    """The program that the scan thread began last."""
    _latest: Order | None = None
    """The order that was decided last, whoever sent it."""
    _report: Report = field(default_factory=Report)
    _events: "count[int]" = field(default_factory=count)
    """Counts links opened and closed."""
    _rules: Rules = field(init=False)
    _lease: CellLease = field(init=False)

    def __post_init__(self) -> None:
        self._rules = Rules(self.programs, self.parameters)
        self._lease = CellLease(self.lease_timeout, self.log)

    # Links.

    def opened(self, source: str, host: str, now: float, is_local: bool = False) -> None:
        """Begin a link; a local one is never silent."""
        self._links[source] = Link(source, host, Watchdog(now), is_local, next(self._events))

    def closed(self, source: str) -> None:
        """End a link; what it holds and runs stays until its host comes back or the time-outs pass."""
        link = self._links.pop(source, None)
        if link is not None:
            link.closed = next(self._events)

    def lost(self, source: str) -> None:
        """Take `source` for lost, whatever its life counter says: what it runs stops, its next number is adopted."""
        link, run = self._links[source], self._run
        _forget(link)
        self._lease.release(link)
        if run is not None and run.link is link and self._is_watched(run):
            self._lose(run, link, "its bus says so")

    def heard(self, source: str, now: float) -> None:
        """Note that any request came from `source`."""
        self._links[source].watchdog.heard = now

    # What links write.

    def wrote(self, source: str, image: CommandImage, now: float, is_numbered: bool = True) -> None:
        """Take the command block as it stands after a write of `source`; it counts once its number was written."""
        self._expire(now)
        link = self._links[source]
        link.has_spoken = True
        before, link.image = link.image, image
        if not link.watchdog.see(image.life, image.life_tail, now):
            self.counts.torn += 1
            self._obey_torn_stop(link, image)
            return
        if is_numbered and link.numbers.must_adopt:
            self._resume(link, image)
        self._update_lease(link, image.lease)
        if image.acknowledge != (before.acknowledge if before else 0):
            self._acknowledge(link, image.acknowledge)
        if is_numbered:
            self._take_number(link, image, now)

    def switched(self, source: str, coils: Mapping[str, bool], now: float) -> None:
        """Take the coils that `source` has just written: execute, stop, reset."""
        self._expire(now)
        link = self._links[source]
        link.watchdog.heard = now
        if link.coils.take_stop(coils):
            self._stop(Order(Command(UNNUMBERED, Control.STOP, source=source)))
        image = link.image or CommandImage()
        link.has_spoken |= bool(coils.keys() & {"execute", "reset"})
        edge = link.coils.take_execute(coils)
        link.executed = self._take_edge(link, edge, link.executed, image, now)
        edge = link.coils.take_reset(coils)
        link.resetting = self._take_edge(link, edge, link.resetting, replace(image, code=Control.RESET), now)

    def _take_edge(self, link: Link, edge: Edge, before: Order | None, image: CommandImage, now: float) -> Order | None:
        """Return what a coil asks for after a write of it, and before that write asked for `before`."""
        if edge is Edge.ROSE:
            return self._command(link, link.numbers.count_up(), image, now)
        if edge is Edge.UNSEEN:
            return self._refuse_new(link, link.numbers.count_up(), image, Refusal.ADOPTED)
        if edge is Edge.LOW and before is not None and before.is_read:
            self._end(before)
        return before

    def submit(self, source: str, image: CommandImage, now: float) -> Refusal:
        """Ask for what a local user wants as the next number of `source`; return why it was refused, if it was."""
        self._expire(now)
        link = self._links[source]
        link.has_spoken, link.image = True, image
        return self._command(link, link.numbers.count_up(), image, now).refusal

    def take(self, source: str) -> bool:
        """Give `source` the lease if it is free; return whether it holds it now."""
        return self._lease.take(self._links[source])

    def release(self, source: str) -> None:
        """Free the lease if `source` holds it."""
        self._lease.release(self._links[source])

    # What the scan thread does.

    def poll(self, now: float) -> Command | None:
        """Return the next thing for the scan thread to do, each once, stops first and the rest as it came.

        A command that the scan thread has neither accepted nor refused by now ended in a fault.
        """
        self._expire(now)
        for order in self._given:
            if not order.is_decided:
                self._decide(order, Result.FAULT)
        self._given = self._orders.next()
        return self._given[0].command if self._given else None

    def accept(self, command: Command) -> None:
        """Take it that `command`, which the scan thread was given last, is done: a program begins, a control is obeyed."""
        for order in self._undecided(command):
            if order.is_program:
                self._seen = order
            self.tags.obey(Control.START if order.is_program else order.command.code)
            self._decide(order, Result.NONE if order.is_program else Result.SUCCESS)

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Take it that `command`, which the scan thread was given last, is not done."""
        for order in self._undecided(command):
            self._refuse(order, refusal)

    def publish(self, report: Report) -> None:
        """Take the scan thread's report; a result in it ends the run whose number it echoes."""
        self._report = report
        run = self._run
        if run is None or not run.is_decided or report.sequence != run.sequence:
            return
        run.report = report
        if report.result is not Result.NONE:
            if run.command.code == FIRST_PROGRAM:
                self.tags.count(report.result)
            self._decide(run, report.result)

    # What links read.

    @property
    def holder(self) -> str:
        """Who holds the lease; empty when it is free."""
        return self._lease.holder.source if self._lease.holder is not None else ""

    @property
    def kept(self) -> frozenset[str]:
        """The links that hold the lease or have a run under way: nobody takes their places."""
        holder, runner = self._lease.holder, self._lease.runner
        return frozenset(link.source for link in (holder, runner) if link is not None)

    @property
    def run(self) -> int:
        """Number in the journal of the run under way or last, whoever started it."""
        return self._report.run

    @property
    def stops_held(self) -> int:
        """How many links hold their stop coil at 1."""
        return sum(link.coils.stop for link in self._links.values())

    @property
    def is_busy(self) -> bool:
        """A program or skill was asked for and has not ended."""
        return self._run is not None

    def answer(self, source: str) -> Answer:
        """Return what `source` shall read."""
        link = self._links[source]
        if link.has_spoken:
            shown, answered, is_busy = link.shown, link.answered, link.shown is not None and link.shown.is_under_way
        else:
            shown, answered, is_busy = self._run or self._seen, self._latest, self.is_busy
        command = shown.command if shown is not None else Command(0, Control.NONE)
        return Answer(
            sequence=command.sequence,
            result=shown.told_to(link) if shown is not None else Result.NONE,
            answered=answered.sequence if answered is not None else 0,
            refusal=answered.refusal if answered is not None else Refusal.NONE,
            refusal_detail=answered.detail if answered is not None else 0,
            answered_result=answered.result if answered is not None else Result.NONE,
            code=command.code,
            is_busy=is_busy,
            lease=self._lease.state_for(link),
            report=self._report_of(shown),
        )

    def inputs(self, source: str) -> Inputs:
        """Return the discrete inputs of `source`: they tell of what its coils asked for, or of its last number."""
        link = self._links[source]
        order = link.executed or link.shown
        if order is None or not (order.is_under_way or order.shown_result is not Result.NONE):
            order = link.resetting
        result = order.told_to(link) if order is not None else Result.NONE
        return Inputs(
            busy=order is not None and order.is_under_way,
            done=order is not None and order.is_program and result is Result.SUCCESS,
            error=result in _ERRORS,
            command_aborted=result is Result.ABORTED,
            ready=self._is_ready_for(link),
        )

    def _is_ready_for(self, link: Link) -> bool:
        is_waiting = self._report.state in (IDLE, COMPLETE)
        return is_waiting and not self.is_busy and not self.stops_held and self._lease.is_open_to(link)

    def _report_of(self, order: Order | None) -> Report:
        """Return the state of the cell with the details of the run `order`; those of another run are left out."""
        told, cell = order.report if order is not None else Report(), self._report
        return replace(
            cell,
            holder=self.holder,
            stage=told.stage,
            reason=told.reason,
            progress=told.progress,
            run=told.run,
            stage_times=told.stage_times,
            total_time=told.total_time,
            hole=told.hole,
            peak_force=told.peak_force,
        )

    # Numbers and commands.

    def _take_number(self, link: Link, image: CommandImage, now: float) -> None:
        verdict = link.numbers.see(image.sequence)
        if verdict is Verdict.LATE:
            self._refuse_late(link, image)
            return
        link.late = None
        if verdict is not Verdict.SAME:
            link.executed = link.resetting = None
        if verdict is Verdict.FIRST:
            self._adopt(link, image)
        elif verdict is Verdict.NEW:
            self._command(link, image.sequence, image, now)

    def _refuse_late(self, link: Link, image: CommandImage) -> None:
        if link.late is None or link.late.sequence != image.sequence:
            link.late = Order(_command_of(link, image.sequence, image))
            self._refuse(link.late, Refusal.LATE)

    def _adopt(self, link: Link, image: CommandImage) -> None:
        """Take a first number for known; of the commands that it may bring only a stop is obeyed."""
        if image.code in STOPS:
            self._command_stop(link, image.sequence, image)
        elif link.shown is not None and link.shown.is_program and _repeats(image, link.shown):
            return
        elif image.code == Control.NONE:
            self._command_nothing(link, image.sequence, image)
        else:
            self._refuse_new(link, image.sequence, image, Refusal.ADOPTED)

    def _command(self, link: Link, sequence: int, image: CommandImage, now: float) -> Order:
        """Answer a number that counts, or pass it on to the scan thread."""
        if image.code in STOPS:
            return self._command_stop(link, sequence, image)
        if image.code == Control.NONE:
            return self._command_nothing(link, sequence, image)
        refusal, detail = self._why_not(link, image), 0
        parameters: tuple[tuple[str, float], ...] = ()
        try:
            parameters = self._rules.parameters_of(image)
        except BadParameterError as error:
            if refusal is Refusal.NONE:
                refusal, detail = Refusal.PARAMETER, error.detail
        order = Order(_command_of(link, sequence, image, parameters), link, detail=detail)
        link.add(order)
        if refusal is not Refusal.NONE:
            self._refuse(order, refusal)
            return order
        self._lease.take(link)
        self._orders.add(order)
        if order.is_program:
            self._run, self._lease.runner = order, link
            link.watchdog.revive(now)
        return order

    def _why_not(self, link: Link, image: CommandImage) -> Refusal:
        refusal = self._rules.refuse_code(image)
        if refusal is not Refusal.NONE:
            return refusal
        if image.code != Control.HOLD and self.stops_held:
            return Refusal.STOP_HELD
        if not self._lease.is_open_to(link):
            return Refusal.NOT_HOLDER
        if (self.is_busy and image.code not in CONTROLS) or self._orders.is_full:
            return Refusal.BUSY
        return Refusal.NONE

    def _command_nothing(self, link: Link, sequence: int, image: CommandImage) -> Order:
        """Answer a number without a command."""
        order = Order(_command_of(link, sequence, image), link)
        link.add(order)
        self._decide(order)
        return order

    def _refuse_new(self, link: Link, sequence: int, image: CommandImage, refusal: Refusal) -> Order:
        """Answer a number with a refusal."""
        order = Order(_command_of(link, sequence, image), link)
        link.add(order)
        self._refuse(order, refusal)
        return order

    def _obey_torn_stop(self, link: Link, image: CommandImage) -> None:
        """Stop at once for a new number whose code says so, although it may not be that number's code.

        The number is answered when the block is whole.
        """
        if image.code in STOPS and image.sequence not in (link.numbers.last, link.torn_stop):
            link.torn_stop = image.sequence
            self._stop(Order(Command(UNNUMBERED, image.code, source=link.source)))

    def _command_stop(self, link: Link, sequence: int, image: CommandImage) -> Order:
        order = Order(_command_of(link, sequence, image), link)
        link.add(order)
        self._stop(order)
        return order

    def _stop(self, order: Order) -> None:
        """Put a stop in front; what has not reached the scan thread yet never will."""
        for dropped in self._orders.stop(order):
            if not dropped.is_decided:
                self._decide(dropped, Result.ABORTED)

    # Answers and results.

    def _undecided(self, command: Command) -> Sequence[Order]:
        """Return the orders that the scan thread was given as `command` and has not decided yet."""
        is_given = bool(self._given) and self._given[0].command is command
        return [order for order in self._given if not order.is_decided] if is_given else []

    def _decide(self, order: Order, result: Result = Result.NONE, refusal: Refusal = Refusal.NONE) -> None:
        order.decide(result, refusal)
        if order.link is not None:
            order.link.told = refusal
        if order.sequence != UNNUMBERED and order.command.code < Control.LOST:
            self._latest = order
        if order is self._run and result is not Result.NONE:
            self._run = self._lease.runner = None

    def _refuse(self, order: Order, refusal: Refusal) -> None:
        self.counts.refusals += 1
        what = "stop" if order.sequence == UNNUMBERED else f"command {order.sequence}"
        link = order.link
        if link is None or link.told is not refusal:
            host = link.host if link is not None else order.command.source
            self.log.warning(host, "%s: %s refused: %s", order.command.source, what, refusal.name)
        self._decide(order, Result.REFUSED, refusal)

    def _acknowledge(self, link: Link, sequence: int) -> None:
        if link.shown is not None and link.shown.sequence == sequence:
            self._end(link.shown)

    def _end(self, order: Order) -> None:
        """Take the result of `order` for read; the cell may leave its state COMPLETE."""
        if order.is_acknowledged or order.result is Result.NONE:
            return
        order.is_acknowledged = True
        if order is self._seen:
            told = Command(order.sequence, Control.ACKNOWLEDGE, source=order.command.source)
            self._orders.add(Order(told, is_decided=True))

    # Leases, links that come back, and links that fall silent.

    def _update_lease(self, link: Link, wish: int) -> None:
        if wish in (Lease.TAKE, Lease.TAKE_FOR_HOST):
            self._lease.take(link)
        elif wish == Lease.RELEASE:
            self._lease.release(link)

    def _resume(self, link: Link, image: CommandImage) -> None:
        """Let a link go on with the run of a closed link of its host: it writes that run's number, and nothing else."""
        for order in (self._run, self._seen):
            earlier = order.link if order is not None else None
            if order is None or earlier is None or not link.follows(earlier) or not _repeats(image, order):
                continue
            self._lease.resume(earlier, link)
            if order is self._run:
                link.watchdog.follow(earlier.watchdog)
                self._lease.runner = link
            link.resume(order)
            return

    def _expire(self, now: float) -> None:
        """Let time-outs act: lost runs, silent holders, blocks that stay torn."""
        link = self._run.link if self._run is not None and self._is_watched(self._run) else None
        if self._run is not None and link is not None and link.watchdog.is_silent(now, self.life_timeout):
            self._lose(self._run, link, f"no sign of life for {self.life_timeout:g} s")
        self._lease.expire(now)
        for link in self._links.values():
            if link.watchdog.is_torn(now, self.life_timeout):
                link.watchdog.torn_since = None
                self._refuse_torn(link)

    def _refuse_torn(self, link: Link) -> None:
        image, numbers = link.image, link.numbers
        if image is None or image.sequence == numbers.last or numbers.must_adopt:
            return
        numbers.last = image.sequence
        self._refuse_new(link, image.sequence, image, Refusal.TORN)

    @staticmethod
    def _is_watched(run: Order) -> bool:
        return run.link is not None and not run.is_lost and not run.link.is_local

    def _lose(self, run: Order, link: Link, why: str) -> None:
        self.log.warning(link.host, "%s is lost: %s", link.source, why)
        self.counts.lost += 1
        run.is_lost = True
        _forget(link)
        self._lease.release(link)
        self._stop(Order(Command(run.sequence, Control.LOST, source=link.source), is_decided=True))


def _forget(link: Link) -> None:
    """Let the link's next number be adopted, and its coils begin anew."""
    link.numbers.forget()
    link.coils.forget()


def _command_of(
    link: Link, sequence: int, image: CommandImage, parameters: tuple[tuple[str, float], ...] = ()
) -> Command:
    return Command(sequence, image.code, image.recipe, image.serial, parameters, link.source)


def _repeats(image: CommandImage, order: Order) -> bool:
    """Tell whether a block has the number of `order`, and either its command once more or none at all."""
    command = order.command
    if image.sequence != command.sequence:
        return False
    asked = (command.code, command.recipe, command.serial)
    return image.code == Control.NONE or asked == (image.code, image.recipe, image.serial)
