"""The state of one link, a conversation with one sequence number, and of its orders; pure.

A link keeps two of its orders in view. One holds the answer: the order decided last. The other holds the result: its
newest order, or its run as long as that is under way.
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
    """True if the order was refused or carried out or, if it is a program, begun."""
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
        """True if it was sent and has not ended."""
        return self.command.code != Control.NONE and self.result is Result.NONE

    @property
    def is_watched(self) -> bool:
        """True if it is a run that stops when its link falls silent."""
        return self.link is not None and not self.is_lost

    @property
    def shown_result(self) -> Result:
        """Return the result until it is acknowledged."""
        return Result.NONE if self.is_acknowledged else self.result

    @property
    def is_shown(self) -> bool:
        """True if the discrete inputs show the order; they do not show a control that has been carried out."""
        is_obeyed = self.shown_result is Result.SUCCESS and not self.is_program
        return self.is_under_way or (self.shown_result is not Result.NONE and not is_obeyed)

    def told_to(self, link: "Link") -> Result:
        """Return the result until it is acknowledged, and record that its own link has read it."""
        self.is_read |= link is self.link and self.result is not Result.NONE
        return self.shown_result

    def repeats(self, image: CommandImage) -> bool:
        """Return True if a block has this number, and repeats this command or has none."""
        command = self.command
        asked = (command.code, command.recipe, command.serial)
        return image.sequence == command.sequence and image.asked in (None, asked)


@dataclass(slots=True, eq=False)
class Link:
    """A TCP connection, the shared connections of a host, a serial line, or a local user."""

    source: str
    host: str
    """Host of the link: one address and one role of TLS, one line, one node. A link can resume one of the same host."""
    watchdog: LinkWatchdog
    opened: int = 0
    """Number of link events (openings and closings) before this link opened; it replaces a time."""
    closed: int | None = None
    """Number of link events before this link closed; it replaces a time; None while it is open."""
    has_spoken: bool = False
    """True if the link has written anything except a stop; until then it is a spectator."""
    image: CommandImage | None = None
    numbers: SequenceNumbers = field(default_factory=SequenceNumbers)
    program: int = 0
    """Number of restarts of the PLC's program while the link was open."""
    writer: Hashable = None
    """Connection that wrote the last number, if several share the link; None after its end."""
    others: dict[Hashable, SequenceNumbers] = field(default_factory=dict)
    """Sequence numbers of other connections; each connection counts for itself."""
    stops: set[Hashable] = field(default_factory=set)
    """Connections of the link that hold their stop coil at 1."""
    coils: dict[str, bool] = field(default_factory=dict)
    """The coils `execute` and `reset` as last written; one that was not written has no entry."""
    shown: Order | None = None
    """Order whose result the link reads; None before its first order."""
    aside: Order | None = None
    """Answer to a number that does not count, until the next one that counts, or until the last one is repeated."""
    requests: dict[str, Order] = field(default_factory=dict)
    """Last request by each of these coils since the link sent a sequence number."""
    was_lost: bool = False
    """True if the link counts as lost and has adopted no number since."""
    torn_stop: int | None = None
    """Number of a torn block whose stop was obeyed at once."""
    told: Refusal = Refusal.NONE
    """Refusal already in the log; the next order without a refusal clears it."""
    has_resumed: bool = False
    """True if the link's first number named the run of an earlier link, which it continues."""
    _asked: list[Order] = field(default_factory=list)

    def follows(self, earlier: "Link") -> bool:
        """Return True if the same host opened this link after `earlier` was closed."""
        return earlier.closed is not None and earlier.host == self.host and earlier.closed < self.opened

    def forget(self) -> None:
        """Adopt the next number, and reset the coils."""
        self.was_lost = True
        for each in (self.numbers, *self.others.values()):
            each.forget()
        self.coils.clear()

    def turn_to(self, writer: Hashable) -> None:
        """Switch to the numbers of the connection that writes; its first number after another connection's is adopted.

        If the last writer has ended its connection, the next one continues with its numbers.
        """
        if self.writer not in (None, writer):
            self.others[self.writer] = self.numbers
            self.numbers = self.others.pop(writer, SequenceNumbers())
            self.numbers.forget()
        self.writer = writer

    def leave(self, connection: Hashable) -> None:
        """End a connection; its stop is released."""
        self.stops.discard(connection)
        self.others.pop(connection, None)
        self.writer = None if self.writer == connection else self.writer

    def add(self, order: Order) -> None:
        """Add a new order of this link; its run stays in view unless the order repeats the run's number."""
        self.aside, self.was_lost = None, False
        self._forget_older_answers()
        self._asked.append(order)
        order.program = self.program
        shown = self.shown
        if shown is None or not shown.is_program or shown.sequence == order.sequence:
            self.shown = order
        # Controls that refer to the run under way, and have no effect after its end.
        elif not (
            shown.is_under_way
            or (order.command.code in (Control.HOLD, Control.UNHOLD) and shown.shown_result is not Result.NONE)
        ):
            # If a hold arrives just after the end of the run, the run's result stays in view.
            self.shown = order

    def begin_anew(self) -> None:
        """Hide all orders of the PLC's program before its restart, except a run that it names."""
        order, self.aside = self.aside, None
        self.program += 1
        if order is not None:
            self._asked = [order]
            if self.shown is None or self.shown.sequence != order.sequence:
                self.shown = order

    def gave(self, order: Order) -> bool:
        """Return True if the present program of the link gave the order."""
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
        """Return True if a number came without a command and has the newest answer."""
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
        """Return the order whose result the link reads; a number that may begin a new count hides the previous count's order."""
        is_empty = self.aside is not None and self.aside.command.code == Control.NONE
        return self.aside if is_empty else self.shown

    @property
    def answered(self) -> Order | None:
        """Return the order decided last."""
        if self.aside is not None and self.aside.is_decided:
            return self.aside
        self._forget_older_answers()
        return self._asked[0] if self._asked and self._asked[0].is_decided else None

    def _forget_older_answers(self) -> None:
        decided = [place for place, order in enumerate(self._asked) if order.is_decided]
        if decided:
            del self._asked[: decided[-1]]
