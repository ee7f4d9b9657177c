"""The simulated switch under the hole as a SuccessSwitch."""

from typing import Protocol

from drivers.quantities import SwitchState


class SwitchSource(Protocol):
    """The world, as far as the switch under the hole sees it."""

    def now(self) -> float:
        """Return the time, s."""

    def is_switch_pressed(self) -> bool:
        """Whether something presses the lever."""


class SimSwitch:
    """Closes when the peg's end reaches the seated depth."""

    def __init__(self, world: SwitchSource) -> None:
        """Attach to the world that has the hole."""
        self._world = world

    def open(self) -> None:
        """Nothing to connect."""

    def close(self) -> None:
        """Nothing to disconnect."""

    def read(self) -> SwitchState:
        """Return whether it is pressed now; the board's 5 ms debounce is below one scan."""
        return SwitchState.CLOSED if self._world.is_switch_pressed() else SwitchState.OPEN
