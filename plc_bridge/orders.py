"""The one queue in which the orders of all links reach the scan thread; pure."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from plc_bridge.links import Order

MOST_WAITING = 8
"""Number of orders that may wait for the scan thread, stops not counted."""


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
