"""The state of one link, which is one conversation with one sequence number, and of the orders that it gave; pure.

A link keeps two of its orders in view: the one whose answer it reads, which is the newest that was decided, and the
one whose result it reads, which is its newest order or, as long as that is under way, its run.
"""

from collections.abc import Hashable
from dataclasses import dataclass, field

from plc_bridge.coils import Coils
from plc_bridge.images import CommandImage
from plc_bridge.messages import FIRST_PROGRAM, Command, Control, Refusal, Report, Result
from plc_bridge.sequence_numbers import SequenceNumbers
from plc_bridge.watchdog import LinkWatchdog

PAUSES = (Control.HOLD, Control.UNHOLD)
"""Controls that mean the run under way, and nothing once it has ended."""


@dataclass(slots=True, eq=False)
class Order:
    """One command of one link, from the write that brought it to its acknowledgement."""

    command: Command
    link: "Link | None" = None
    """Link that reads how the order ended; None where nobody does."""
    program: int = 0
    """Program of the link that gave it, see `Link.program`."""
    is_decided: bool = False
    """Whether the order was refused, obeyed or, if it is a program, begun."""
    result: Result = Result.NONE
    refusal: Refusal = Refusal.NONE
    detail: int = 0
    """Detail of the refusal, as `report_refusal_detail`."""
    is_acknowledged: bool = False
    is_read: bool = False
    """Whether its link was told the result."""
    is_lost: bool = False
    """Whether its link fell silent while the order ran."""
    report: Report = field(default_factory=Report)
    """Report that the scan thread made of it last."""

    @property
    def sequence(self) -> int:
        """Number under which its link sent it."""
        return self.command.sequence

    @property
    def is_program(self) -> bool:
        """Whether it is a program or a skill, and not a control."""
        return FIRST_PROGRAM <= self.command.code < Control.LOST

    @property
    def is_under_way(self) -> bool:
        """Whether it was sent and has not ended."""
        return self.command.code != Control.NONE and self.result is Result.NONE

    @property
    def is_watched(self) -> bool:
        """Whether it is a run that stops when its link falls silent."""
        return self.link is not None and not self.is_lost and not self.link.is_local

    @property
    def shown_result(self) -> Result:
        """Return the result until it is acknowledged."""
        return Result.NONE if self.is_acknowledged else self.result

    def told_to(self, link: "Link") -> Result:
        """Return the result until it is acknowledged, and remember when its own link was told."""
        self.is_read |= link is self.link and self.result is not Result.NONE
        return self.shown_result

    def repeats(self, image: CommandImage) -> bool:
        """Tell whether a block has this number, and either this command once more or none at all."""
        command = self.command
        asked = (command.code, command.recipe, command.serial)
        return image.sequence == command.sequence and image.asked in (None, asked)


@dataclass(slots=True, eq=False)
class Link:
    """A TCP connection, or all connections of a host that asked for that, or a serial line, or a local user."""

    source: str
    host: str
    """Links of the same host may follow each other: one address and one role of TLS, one line, one node."""
    watchdog: LinkWatchdog
    is_local: bool = False
    opened: int = 0
    """Number of links opened and closed before this link was opened, which stands for the time."""
    closed: int | None = None
    """Number of links opened and closed before this link was closed, which stands for the time; None while it is open."""
    has_spoken: bool = False
    """Whether the link has written anything but a stop; until then it is a spectator."""
    image: CommandImage | None = None
    numbers: SequenceNumbers = field(default_factory=SequenceNumbers)
    program: int = 0
    """Number of programs that have started anew on the link while it was open."""
    writer: Hashable = None
    """Connection that wrote the last number, where several share the link; None once it has gone."""
    others: dict[Hashable, SequenceNumbers] = field(default_factory=dict)
    """Numbers of other connections that have written some: each counts for itself."""
    stops: set[Hashable] = field(default_factory=set)
    """Connections of the link that hold their stop coil at 1."""
    coils: Coils = field(default_factory=Coils)
    shown: Order | None = None
    """Order whose result the link reads; None before its first order."""
    aside: Order | None = None
    """Answer to a number that is not the last one to count, until a number that counts comes, or the last one again."""
    executed: Order | None = None
    """Last request by the link's coil `execute`; None once the link has sent a sequence number."""
    resetting: Order | None = None
    """Last request by the link's coil `reset`; None once the link has sent a sequence number."""
    was_lost: bool = False
    """Whether the link was taken for lost and has adopted no number since."""
    torn_stop: int | None = None
    """Number of a torn block whose stop was obeyed at once."""
    told: Refusal = Refusal.NONE
    """Refusal that the log has already named; it is forgotten once an order of the link is not refused."""
    has_resumed: bool = False
    """Whether the link goes on with the run of an earlier link, which its first number named."""
    _asked: list[Order] = field(default_factory=list)

    def follows(self, earlier: "Link") -> bool:
        """Tell whether it was opened by the same host after `earlier` had been closed."""
        return earlier.closed is not None and earlier.host == self.host and earlier.closed < self.opened

    def forget(self) -> None:
        """Let the next number be adopted, and the coils begin anew."""
        self.was_lost = True
        for each in (self.numbers, *self.others.values()):
            each.forget()
        self.coils = Coils()

    def turn_to(self, writer: Hashable) -> None:
        """Go on with the numbers of a connection that has written one: its first number after another's is adopted.

        A connection that comes after the last writer has gone goes on with the numbers of that.
        """
        if self.writer not in (None, writer):
            self.others[self.writer] = self.numbers
            self.numbers = self.others.pop(writer, SequenceNumbers())
            self.numbers.forget()
        self.writer = writer

    def leave(self, connection: Hashable) -> None:
        """End a connection: the stop that it held falls."""
        self.stops.discard(connection)
        self.others.pop(connection, None)
        self.writer = None if self.writer == connection else self.writer

    def add(self, order: Order) -> None:
        """Take a new order of this link; its run stays in view, unless the PLC sent that run's number once more."""
        self.aside, self.was_lost = None, False
        self._forget_older_answers()
        self._asked.append(order)
        order.program = self.program
        shown = self.shown
        if shown is None or not shown.is_program or shown.sequence == order.sequence:
            self.shown = order
        elif not (shown.is_under_way or (order.command.code in PAUSES and shown.shown_result is not Result.NONE)):
            # A hold that crosses the end of the run does not hide how that ended.
            self.shown = order

    def begin_anew(self) -> None:
        """Let a program that has started anew see nothing of the program before, but a run that it names."""
        order, self.aside = self.aside, None
        self.program += 1
        if order is not None:
            self._asked = [order]
            if self.shown is None or self.shown.sequence != order.sequence:
                self.shown = order

    def gave(self, order: Order) -> bool:
        """Tell whether its present program gave an order."""
        return order.link is self and order.program == self.program and not self.numbers.is_in_doubt

    def came_empty(self, sequence: int) -> bool:
        """Tell whether a number came without a command and is the newest that was answered."""
        answered = self.answered
        return answered is not None and answered.sequence == sequence and answered.command.code == Control.NONE

    def resume(self, order: Order) -> None:
        """Go on with the order of an earlier link of the same host, and with what that link was answered last."""
        earlier, self.shown, self.has_resumed = order.link, order, True
        self._asked = [order] if earlier is None else [*earlier._asked] or [order]
        for each in (order, *self._asked):
            each.link, each.program = self, self.program

    @property
    def in_view(self) -> Order | None:
        """Return the order whose result the link reads; a number that may begin a new count hides that of the count before."""
        is_empty = self.aside is not None and self.aside.command.code == Control.NONE
        return self.aside if is_empty else self.shown

    @property
    def answered(self) -> Order | None:
        """Return the newest order that was decided."""
        if self.aside is not None and self.aside.is_decided:
            return self.aside
        self._forget_older_answers()
        return self._asked[0] if self._asked and self._asked[0].is_decided else None

    def _forget_older_answers(self) -> None:
        decided = [place for place, order in enumerate(self._asked) if order.is_decided]
        if decided:
            del self._asked[: decided[-1]]
