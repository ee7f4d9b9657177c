"""The cell's clock if emulated boards run beside the simulated world."""

from typing import Protocol

from drivers.protocols import Clock


class TimedBoard(Protocol):
    """A board that computes in its own time."""

    def due(self) -> float:
        """Return the latest time of the board's next look at the world, s; infinite if it needs none."""

    def advance(self) -> None:
        """Run up to the world's present time."""


class BoardClock:
    """Advances the world and then every board to the same instant, so that all keep simulated time."""

    def __init__(self, world: Clock, boards: tuple[TimedBoard, ...]) -> None:
        """Store the world's clock and the boards, in the order of their advance."""
        self._world, self.boards = world, boards

    def now(self) -> float:
        """Return the simulated time, s."""
        return self._world.now()

    def wait_until(self, stamp: float) -> None:
        """Advance world and boards to `stamp`, with a stop at each time at which a board reads the world."""
        while (due := min((board.due() for board in self.boards), default=stamp)) < stamp:
            self._go(due)
            if min(board.due() for board in self.boards) <= due:
                break  # the world's step is coarser than the board's
        self._go(stamp)

    def _go(self, stamp: float) -> None:
        self._world.wait_until(stamp)
        for board in self.boards:
            board.advance()
