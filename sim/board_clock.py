"""The cell's clock when emulated boards run beside the simulated world."""

from typing import Protocol

from drivers.protocols import Clock


class Board(Protocol):
    """Something that computes on its own time."""

    def due(self) -> float:
        """Return when it has to see the world next, s; infinite when that does not matter."""

    def advance(self) -> None:
        """Run until the world's present time."""


class BoardClock:
    """Lets the world go on, then every board up to the same instant: all of them keep simulated time."""

    def __init__(self, world: Clock, boards: tuple[Board, ...]) -> None:
        """Take the world's clock and the boards in the order in which they advance."""
        self._world, self.boards = world, boards

    def now(self) -> float:
        """Return the simulated time, s."""
        return self._world.now()

    def wait_until(self, stamp: float) -> None:
        """Advance world and boards to `stamp`, with a stop wherever a board has to see the world."""
        while (due := min((board.due() for board in self.boards), default=stamp)) < stamp:
            self._go(due)
            if min(board.due() for board in self.boards) <= due:
                break  # the world's step is coarser than that
        self._go(stamp)

    def _go(self, stamp: float) -> None:
        self._world.wait_until(stamp)
        for board in self.boards:
            board.advance()
