"""The cell's clock if emulated boards run together with the physics."""

from typing import Protocol

from drivers.protocols import Clock


class TimedBoard(Protocol):
    """A board that computes in its own time."""

    def due(self) -> float:
        """Return the time at which the board next reads its inputs, s; infinite if the clock needs no extra stop for it."""

    def advance(self) -> None:
        """Run the board up to the present time of the physics."""


class BoardClock:
    """Advances the physics and then every board to the same instant, so that all keep simulated time."""

    def __init__(self, world: Clock, boards: tuple[TimedBoard, ...]) -> None:
        """Store the clock of the physics, and the boards in the order of their advance."""
        self._world, self.boards = world, boards

    def now(self) -> float:
        """Return the simulated time, s."""
        return self._world.now()

    def wait_until(self, stamp: float) -> None:
        """Advance physics and boards to `stamp`, with a stop at each time at which a board reads its inputs."""
        while (due := min((board.due() for board in self.boards), default=stamp)) < stamp:
            self._go(due)
            if min(board.due() for board in self.boards) <= due:
                break  # the step of the physics is longer than the board's
        self._go(stamp)

    def _go(self, stamp: float) -> None:
        self._world.wait_until(stamp)
        for board in self.boards:
            board.advance()
