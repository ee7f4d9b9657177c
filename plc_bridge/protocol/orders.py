"""The cell's queue of orders, each from the write of a number, a torn block or a coil to its acknowledgement; pure.

An order is decided as soon as it is refused, its control is carried out, or its program begins. A program has its result
at its end.
"""

from collections import deque
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from plc_bridge.protocol.images import CommandImage, is_serial
from plc_bridge.protocol.lease import CellLease
from plc_bridge.protocol.links import Link, Order
from plc_bridge.protocol.messages import (
    AFTER_A_LOSS,
    CONTROLS,
    FIRST_PROGRAM,
    REMEDIES,
    SERIAL_NUMBER,
    UNNUMBERED,
    Command,
    Control,
    Diagnostics,
    Refusal,
    Report,
    Result,
)
from plc_bridge.protocol.packml import PackTags
from plc_bridge.protocol.peer_log import PeerLog
from plc_bridge.protocol.registers import VERSION_MAJOR, Parameter
from plc_bridge.protocol.sequence_numbers import NumberMeaning

STOPS = frozenset({Control.STOP.value, Control.ABORT.value})
"""Controls that every link may give, and that precede all other commands."""
MOST_WAITING = 8
"""Largest number of orders that wait for the scan thread, without stops."""


@dataclass(slots=True)
class Orders:
    """The queue: first in, first out. Stops precede all other orders and drop those that wait.

    Args:
        lease: The lease of the cell; the queue sets its `runner`, the link whose run is under way.
        log: Logger of refusals.
        programs: Name of each program and skill by its command code, from 100 on.
        parameters: Meaning of the numbered parameters.
    """

    lease: CellLease
    log: PeerLog
    programs: Mapping[int, str] = field(default_factory=dict)
    parameters: Sequence[Parameter] = ()
    links: dict[str, Link] = field(default_factory=dict)
    """Open links, by their source."""
    counts: Diagnostics = field(default_factory=Diagnostics)
    """Refusals, torn blocks and lost runs since the start."""
    tags: PackTags = field(default_factory=PackTags)
    run: Order | None = None
    """Program that waits for the scan thread or is under way."""
    seen: Order | None = None
    """Program that the scan thread began last."""
    latest: Order | None = None
    """Order of any link that was decided last."""
    report: Report = field(default_factory=Report)
    """Report that the scan thread published last."""
    # Largest number of ended programs that wait for their reader.
    ended: deque[Order] = field(default_factory=lambda: deque(maxlen=16))
    """Programs that have ended and that the reader has not taken yet."""
    _waiting: deque[Order] = field(default_factory=deque)
    _stops: dict[int, list[Order]] = field(default_factory=dict)
    _given: Sequence[Order] = ()
    """Orders given to the scan thread last, as one command; equal stops of several links are given together."""

    # Calls of the scan thread.

    def next(self) -> Command | None:
        """Return the next command for the scan thread, each command once: stops first, then in order of arrival.

        If the scan thread has neither accepted nor refused the previous command, that command ends with FAULT.
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
        """Record that the scan thread accepts `command`, the one given last: a program has begun, or a control is done."""
        for order in self._undecided(command):
            if order.is_program:
                self.seen = order
            self.tags.obey(Control.START if order.is_program else order.command.code)
            self.decide(order, Result.NONE if order.is_program else Result.SUCCESS)

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Record that the scan thread refuses `command`, the one given last."""
        for order in self._undecided(command):
            self.turn_down(order, refusal)

    def publish(self, report: Report) -> None:
        """Take the scan thread's report; a result in the report ends the run that has the report's sequence number."""
        self.report = report
        run = self.run
        if run is None or not run.is_decided or report.sequence != run.sequence:
            return
        run.report = report
        result = Result(report.result)
        if result is not Result.NONE:
            if run.command.code == FIRST_PROGRAM:
                self.tags.count(result)
            self.decide(run, result)

    def _undecided(self, command: Command) -> Sequence[Order]:
        """Return the orders of `command` that the scan thread has not decided yet."""
        is_given = bool(self._given) and self._given[0].command is command
        return [order for order in self._given if not order.is_decided] if is_given else []

    # Decisions on orders.

    def add(self, order: Order) -> None:
        """Append an order; a program becomes the run."""
        self._waiting.append(order)
        if order.is_program:
            self.run, self.lease.runner = order, order.link

    def stop(self, order: Order) -> None:
        """Put a stop in front of the queue, and end the waiting orders as aborted."""
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
        """Mark the result of `order` as acknowledged; if it is the last program, let the scan thread leave COMPLETE."""
        if order.is_acknowledged or order.result is Result.NONE:
            return
        order.is_acknowledged = True
        if order is self.seen:
            told = Command(order.sequence, Control.ACKNOWLEDGE, source=order.command.source)
            self.add(Order(told, is_decided=True))

    # Numbers of links.

    def take_number(self, link: Link, image: CommandImage, code_before: int) -> None:
        """Process the number of a whole block; `code_before` is the code of the previous write."""
        numbers = link.numbers
        verdict = numbers.see(image.sequence, image.asked, image.life)
        if verdict is NumberMeaning.ANEW:
            link.was_lost = False
            link.requests.clear()
            link.aside = Order(_command(link, image.sequence, image), is_decided=True)
        if numbers.is_anew and not numbers.is_in_doubt:
            numbers.is_anew = False
            link.begin_anew()
        if verdict is NumberMeaning.LATE or (verdict is NumberMeaning.DOUBT and image.code in STOPS):
            self._take_late(link, image)
        elif verdict is NumberMeaning.SAME:
            self._take_same(link, image, code_before)
        elif verdict in (NumberMeaning.FIRST, NumberMeaning.NEW):
            self._take_new(link, image, verdict is NumberMeaning.FIRST)

    def _take_new(self, link: Link, image: CommandImage, is_first: bool) -> None:
        """Process a number ahead of the last one; the first one of a count is adopted."""
        link.requests.clear()
        if is_first and image.code not in STOPS:
            self._adopt(link, image)
        elif image.code == Control.NONE:
            self.decide(_order(link, image.sequence, image))  # a number without a command
        else:
            self.command(link, image.sequence, image)

    def _take_same(self, link: Link, image: CommandImage, code_before: int) -> None:
        """Process a repeated number: obey only a stop; if it first came without a command, refuse any other command."""
        link.was_lost = False
        if link.aside is not None and link.aside.sequence != image.sequence:
            link.aside = None
        if image.code == code_before:
            return
        is_empty = link.came_empty(image.sequence)
        if image.code in STOPS:
            self._stop_for(link, image, image.sequence if is_empty else UNNUMBERED)
        elif image.code != Control.NONE and is_empty:
            self._refuse_new(link, image, image.sequence, Refusal.ADOPTED)

    def _take_late(self, link: Link, image: CommandImage) -> None:
        """Answer a number behind the last one without replacing the last answer: obey a stop, refuse another command."""
        run, aside = link.shown, link.aside
        if run is not None and run.is_program and run.repeats(image):
            return  # it repeats the run in view, whose number is behind those of later controls
        if aside is not None and aside.repeats(image) and aside.command.code == image.code:
            return
        link.aside = Order(_command(link, image.sequence, image))
        if image.code in STOPS:
            self.stop(link.aside)
        else:
            self.turn_down(link.aside, Refusal.LATE)

    def _adopt(self, link: Link, image: CommandImage) -> None:
        """Adopt a first number without running its command; if it is the number of the run in view, nothing changes."""
        shown = link.shown
        if link.has_resumed or (shown is not None and shown.is_program and shown.repeats(image)):
            link.was_lost = False
        elif image.code == Control.NONE:
            self.decide(_order(link, image.sequence, image))  # a number without a command
        else:
            self._refuse_new(link, image, image.sequence, Refusal.ADOPTED)

    def _refuse_new(self, link: Link, image: CommandImage, sequence: int, refusal: Refusal) -> Order:
        """Answer a number with a refusal."""
        detail = AFTER_A_LOSS if refusal is Refusal.ADOPTED and link.was_lost else 0
        order = _order(link, sequence, image, detail=detail)
        self.turn_down(order, refusal)
        return order

    def _stop_for(self, link: Link, image: CommandImage, sequence: int = UNNUMBERED) -> Order:
        """Stop at once; a stop with its own number gets an answer, a stop with the run's number shows in the run's result."""
        shown = link.shown
        if shown is not None and shown.is_program and shown.sequence == sequence:
            sequence = UNNUMBERED
        order = Order(_command(link, sequence, image)) if sequence == UNNUMBERED else _order(link, sequence, image)
        self.stop(order)
        return order

    # Coils of links.

    @property
    def stops_held(self) -> int:
        """Number of connections that hold their stop coil at 1."""
        return sum(len(link.stops) for link in self.links.values())

    def take_coils(self, link: Link, coils: Mapping[str, bool], by: Hashable) -> None:
        """Process the coils that a connection of a link has just written."""
        if coils.get("stop") is False:
            link.stops.discard(by)
        elif "stop" in coils and by not in link.stops:
            link.stops.add(by)
            self._stop_for(link, CommandImage(code=Control.STOP))
        image = link.image or CommandImage()
        link.has_spoken |= bool(coils.keys() & {"execute", "reset"})
        for coil, code in (("execute", image.code), ("reset", Control.RESET)):
            if coil in coils:
                self._take_level(link, coil, coils[coil], replace(image, code=code))

    def _take_level(self, link: Link, coil: str, level: bool, image: CommandImage) -> None:
        """Process a written coil: its rising edge is a request, its falling edge acknowledges the result if it was read.

        If a coil is 1 in the first write after its link opened or was lost, its rising edge was not seen. Its command may
        have run before the loss, so it is not run again.
        """
        was, link.coils[coil] = link.coils.get(coil), level
        if level and was is None:
            link.requests[coil] = self._refuse_new(link, image, link.numbers.give(), Refusal.ADOPTED)
        elif level and not was:
            link.requests[coil] = self.command(link, link.numbers.give(), image)
        elif not level and coil in link.requests and link.requests[coil].is_read:
            self.end(link.requests[coil])

    # Commands.

    def control(self, link: Link, code: int) -> Order:
        """Answer a control without a number, or pass it on; only the returned order holds its answer."""
        image = CommandImage(code=code)
        if code in STOPS:
            return self._stop_for(link, image)
        order = Order(_command(link, UNNUMBERED, image))
        self._pass_on(order, link, self._why_not(link, image))
        return order

    def command(self, link: Link, sequence: int, image: CommandImage) -> Order:
        """Answer a new number, or pass its command on to the scan thread."""
        if image.code in STOPS:
            return self._stop_for(link, image, sequence)
        parameters, detail = self._parameters_of(image)
        refusal = self._why_not(link, image) or (Refusal.PARAMETER if detail else Refusal.NONE)
        order = _order(link, sequence, image, parameters, detail if refusal is Refusal.PARAMETER else 0)
        self._pass_on(order, link, refusal)
        if order.is_under_way and order.is_program:
            link.watchdog.revive()
        return order

    def _pass_on(self, order: Order, link: Link, refusal: Refusal) -> None:
        """Refuse an order, or append it; an order takes a free lease."""
        if refusal is not Refusal.NONE:
            self.turn_down(order, refusal)
            return
        self.lease.take(link)
        self.add(order)

    def _why_not(self, link: Link, image: CommandImage) -> Refusal:
        """Return the refusal of a command, or NONE; the parameters are checked elsewhere."""
        is_program = image.code not in CONTROLS
        if image.version and image.version >> 8 != VERSION_MAJOR:
            return Refusal.VERSION
        if is_program and image.code not in self.programs:
            return Refusal.UNKNOWN_CODE
        if image.code != Control.HOLD and self.stops_held:
            return Refusal.STOP_HELD
        if not self.lease.is_open_to(link):
            return Refusal.NOT_HOLDER
        if (self.run is not None and is_program) or len(self._waiting) >= MOST_WAITING:
            return Refusal.BUSY
        return Refusal.NONE

    def _parameters_of(self, image: CommandImage) -> tuple[tuple[tuple[str, float], ...], int]:
        """Return the parameters in their units, and 0 or the detail of their refusal.

        The detail is the number, from 1, of a parameter that is unknown or beyond its limits, or `SERIAL_NUMBER` if the
        serial number cannot be printed.
        """
        if not is_serial(image.serial):
            return (), SERIAL_NUMBER
        values = []
        for number, count in image.parameters:
            if number >= len(self.parameters):
                return (), number + 1
            spec = self.parameters[number]
            value = count * spec.scale
            slack = spec.scale / 2  # limits need not be a multiple of the scale
            if not spec.low - slack <= value <= spec.high + slack:
                return (), number + 1
            values.append((spec.name, min(max(value, spec.low), spec.high)))
        return tuple(values), 0

    # Torn blocks of links.

    def take_torn(self, link: Link, image: CommandImage) -> None:
        """Obey a stop at once, although the code may belong to another number than the block's.

        The number is answered when the block is whole.
        """
        self.counts.torn += 1
        earlier, link.torn = (link.image, link.torn), image
        had = [(each.sequence, each.code) for each in earlier if each is not None]
        if image.code in STOPS and (image.sequence, image.code) not in had:
            self._stop_for(link, image)

    def refuse_torn(self, link: Link) -> None:
        """Refuse the number of a block that has been torn for too long."""
        link.watchdog.torn_since, image = None, link.torn
        if image is not None and link.numbers.would_count(image.sequence):
            link.numbers.see(image.sequence, image.asked, image.life)
            self._refuse_new(link, image, image.sequence, Refusal.TORN)


def _command(link: Link, sequence: int, image: CommandImage, parameters: tuple[tuple[str, float], ...] = ()) -> Command:
    return Command(sequence, image.code, image.recipe, image.serial, parameters, link.source)


def _order(
    link: Link, sequence: int, image: CommandImage, parameters: tuple[tuple[str, float], ...] = (), detail: int = 0
) -> Order:
    """Return a new order after adding it to its link, which then reads the order's answer."""
    order = Order(_command(link, sequence, image, parameters), link, detail=detail)
    link.add(order)
    return order
