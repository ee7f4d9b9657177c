"""The state of one link and of its orders; a link is one conversation with one count of sequence numbers; pure.

A link reads two of its orders. The order decided last gives the answer. The order in view gives the result: the run while
it is under way, afterwards the newest order.
"""

from collections.abc import Hashable
from dataclasses import dataclass, field

from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.messages import FIRST_PROGRAM, Command, Control, Refusal, Report, Result
from plc_bridge.protocol.sequence_numbers import SequenceNumbers
from plc_bridge.protocol.watchdog import LinkWatchdog


@dataclass(slots=True, eq=False)
class Order:
    """One command of one link, from its write to its acknowledgement."""

    command: Command
    link: "Link | None" = None
    """Link that reads the order's result; None if none does."""
    program: int = 0
    """Number of the link's program when the order was given, see `Link.program`."""
    is_decided: bool = False
    """True if the order was refused, if its control was carried out, or if its program has begun."""
    result: Result = Result.NONE
    refusal: Refusal = Refusal.NONE
    detail: int = 0
    """Detail of the refusal, as `report_refusal_detail`."""
    is_acknowledged: bool = False
    is_read: bool = False
    """True if its link has read the result."""
    is_lost: bool = False
    """True if its link fell silent while the order ran."""
    report: Report = field(default_factory=Report)
    """Report of the order that the scan thread published last."""

    @property
    def sequence(self) -> int:
        """Sequence number of the order on its link."""
        return self.command.sequence

    @property
    def is_program(self) -> bool:
        """True if it is a program or a skill, False if it is a control."""
        return FIRST_PROGRAM <= self.command.code < Control.LOST

    @property
    def is_under_way(self) -> bool:
        """True if the order has a command and no result yet."""
        return self.command.code != Control.NONE and self.result is Result.NONE

    @property
    def is_watched(self) -> bool:
        """True if the run must stop when its link falls silent."""
        return self.link is not None and not self.is_lost

    @property
    def shown_result(self) -> Result:
        """Result of the order; NONE once it is acknowledged."""
        return Result.NONE if self.is_acknowledged else self.result

    @property
    def is_shown(self) -> bool:
        """True if the discrete inputs show the order; they do not show a control that has been carried out."""
        is_obeyed = self.shown_result is Result.SUCCESS and not self.is_program
        return self.is_under_way or (self.shown_result is not Result.NONE and not is_obeyed)

    def told_to(self, link: "Link") -> Result:
        """Return the result, NONE once acknowledged; if `link` is the order's own, record that the link has read it."""
        self.is_read |= link is self.link and self.result is not Result.NONE
        return self.shown_result

    def repeats(self, image: CommandImage) -> bool:
        """Return True if a block has the order's number, and the order's command or no command."""
        command = self.command
        asked = (command.code, command.recipe, command.serial)
        return image.sequence == command.sequence and image.asked in (None, asked)


@dataclass(slots=True, eq=False)
class Link:
    """A TCP connection, the shared connections of a host, a serial line, a CAN node, or a local user."""

    source: str
    host: str
    """Host of the link: an address with its TLS role, a serial line, or a node. A link can resume a run of its own host."""
    watchdog: LinkWatchdog
    opened: int = 0
    """Number of link events (openings and closings) before this link opened; it orders events as a time would."""
    closed: int | None = None
    """Number of link events before this link closed; None while the link is open."""
    has_spoken: bool = False
    """True if the link has written anything except a stop; until then it is a spectator."""
    image: CommandImage | None = None
    """Last whole block."""
    torn: CommandImage | None = None
    """Last block if it was torn."""
    numbers: SequenceNumbers = field(default_factory=SequenceNumbers)
    program: int = 0
    """Number of restarts of the PLC's program while the link was open."""
    writer: Hashable = None
    """Connection that wrote the last number, if several share the link; None after its end."""
    others: dict[Hashable, SequenceNumbers] = field(default_factory=dict)
    """Sequence numbers of the link's other connections; each connection has its own count."""
    stops: set[Hashable] = field(default_factory=set)
    """Connections of the link that hold their stop coil at 1."""
    coils: dict[str, bool] = field(default_factory=dict)
    """Last written values of the coils `execute` and `reset`; a coil has no entry before its first write."""
    shown: Order | None = None
    """Order whose result the link reads; None before its first order."""
    aside: Order | None = None
    """Order that answers a late number or the first number of a restarted program.

    The next counting number deletes it, and so does a repetition of the last counting number.
    """
    requests: dict[str, Order] = field(default_factory=dict)
    """Last request by each of the coils `execute` and `reset` since the link's last new sequence number."""
    was_lost: bool = False
    """True if the link counts as lost and has adopted no number since."""
    told: Refusal = Refusal.NONE
    """Refusal already in the log; the next order without a refusal clears it."""
    has_resumed: bool = False
    """True if the link's first number named the run of an earlier link, which it continues."""
    _asked: list[Order] = field(default_factory=list)

    def follows(self, earlier: "Link") -> bool:
        """Return True if the same host opened this link after `earlier` was closed."""
        return earlier.closed is not None and earlier.host == self.host and earlier.closed < self.opened

    def forget(self) -> None:
        """Treat the link as lost: its next number will be adopted, and its coils count as not yet written."""
        self.was_lost = True
        for each in (self.numbers, *self.others.values()):
            each.forget()
        self.coils.clear()

    def turn_to(self, writer: Hashable) -> None:
        """Switch to the numbers of the connection that writes; its first number after another connection's is adopted.

        If the last writer's connection has ended, the next writer continues the count of that connection.
        """
        if self.writer not in (None, writer):
            self.others[self.writer] = self.numbers
            self.numbers = self.others.pop(writer, SequenceNumbers())
            self.numbers.forget()
        self.writer = writer

    def leave(self, connection: Hashable) -> None:
        """End a connection, and release the stop that it holds."""
        self.stops.discard(connection)
        self.others.pop(connection, None)
        self.writer = None if self.writer == connection else self.writer

    def add(self, order: Order) -> None:
        """Add a new order; the link still reads the result of a run under way unless the order has the run's number.

        If the link counts, a control by a coil shows in the discrete inputs only: the block's answer and result stay.
        """
        if not order.is_program and self.numbers.last not in (None, order.sequence):
            return
        self.aside, self.was_lost = None, False
        self._forget_older_answers()
        self._asked.append(order)
        order.program = self.program
        shown = self.shown
        if shown is None or not shown.is_program or shown.sequence == order.sequence:
            self.shown = order
        # HOLD and UNHOLD refer to the run under way, and have no effect after its end.
        elif not (
            shown.is_under_way
            or (order.command.code in (Control.HOLD, Control.UNHOLD) and shown.shown_result is not Result.NONE)
        ):
            # If a hold arrives just after the end of the run, the run's result stays in view.
            self.shown = order

    def begin_anew(self) -> None:
        """Hide all orders from before the restart of the PLC's program, except a run whose number it now sends."""
        order, self.aside = self.aside, None
        self.program += 1
        if order is not None:
            self._asked = [order]
            if self.shown is None or self.shown.sequence != order.sequence:
                self.shown = order

    def gave(self, order: Order) -> bool:
        """Return True if this link gave the order and the PLC's program has certainly not restarted since."""
        return order.link is self and order.program == self.program and not self.numbers.is_in_doubt

    def continues(self, order: Order, image: CommandImage) -> bool:
        """Return True if the block of this link continues the order of a closed link of its host.

        The block must have the order's own number, or the last number of the earlier link, for example after a hold.
        """
        earlier = order.link
        if earlier is None or not (self.follows(earlier) and earlier.gave(order)):
            return False
        stood = earlier.image
        is_last = stood is not None and image.sequence == earlier.numbers.last == stood.sequence
        return order.repeats(image) or (is_last and stood is not None and image.asked in (None, stood.asked))

    def came_empty(self, sequence: int) -> bool:
        """Return True if `sequence` has the newest answer and came without a command."""
        answered = self.answered
        return answered is not None and answered.sequence == sequence and answered.command.code == Control.NONE

    def resume(self, order: Order) -> None:
        """Continue the order of an earlier link of the same host, with that link's last answer."""
        earlier, self.shown, self.has_resumed = order.link, order, True
        self._asked = [order] if earlier is None else [*earlier._asked] or [order]
        for each in (order, *self._asked):
            each.link, each.program = self, self.program

    @property
    def in_view(self) -> Order | None:
        """Order whose result the link reads; if a number without a command may begin a new count, that number's order."""
        is_empty = self.aside is not None and self.aside.command.code == Control.NONE
        return self.aside if is_empty else self.shown

    @property
    def answered(self) -> Order | None:
        """Order decided last; None if none is decided."""
        if self.aside is not None and self.aside.is_decided:
            return self.aside
        self._forget_older_answers()
        return self._asked[0] if self._asked and self._asked[0].is_decided else None

    def _forget_older_answers(self) -> None:
        decided = [place for place, order in enumerate(self._asked) if order.is_decided]
        if decided:
            del self._asked[: decided[-1]]
