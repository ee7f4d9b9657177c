"""Orders: the requests of links, how each one ends, and the one queue in which they reach the scan thread; pure."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from plc_bridge.messages import FIRST_PROGRAM, Command, Control, Refusal, Report, Result

if TYPE_CHECKING:
    from plc_bridge.links import Link

MOST_WAITING = 8
"""Number of orders that may wait for the scan thread, stops not counted."""


@dataclass(slots=True, eq=False)
class Order:
    """One command of one link, from the write that brought it to its acknowledgement."""

    command: Command
    link: "Link | None" = None
    """Link that reads how the order ended; None where nobody does."""
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
    def shown_result(self) -> Result:
        """Return the result until it is acknowledged."""
        return Result.NONE if self.is_acknowledged else self.result

    def told_to(self, link: "Link") -> Result:
        """Return the result until it is acknowledged, and remember when its own link was told."""
        self.is_read |= link is self.link and self.result is not Result.NONE
        return self.shown_result

    def decide(self, result: Result = Result.NONE, refusal: Refusal = Refusal.NONE) -> None:
        """Take note of the decision on the order."""
        self.is_decided, self.result, self.refusal = True, result, refusal


@dataclass(slots=True)
class Orders:
    """The queue: first come, first served; stops alone go ahead of everything, and drop what waits behind them."""

    _waiting: deque[Order] = field(default_factory=deque)
    _stops: dict[int, list[Order]] = field(default_factory=dict)

    @property
    def is_full(self) -> bool:
        """Tell whether no more orders may wait."""
        return len(self._waiting) >= MOST_WAITING

    def add(self, order: Order) -> None:
        """Put an order at the end."""
        self._waiting.append(order)

    def stop(self, order: Order) -> Sequence[Order]:
        """Put a stop in front and return the orders that will never reach the scan thread because of it."""
        dropped = tuple(self._waiting)
        self._waiting.clear()
        self._stops.setdefault(order.command.code, []).append(order)
        return dropped

    def next(self) -> Sequence[Order]:
        """Return the orders that the scan thread decides next, all of the same command; none when none waits."""
        if self._stops:
            return self._stops.pop(max(self._stops))
        return (self._waiting.popleft(),) if self._waiting else ()
