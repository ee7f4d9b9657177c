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
        self.is_unplugged = False
        """Whether the board's cable is pulled out."""

    def open(self) -> None:
        """Do nothing: there is no connection."""

    def close(self) -> None:
        """Do nothing: there is no connection."""

    def read(self) -> SwitchState:
        """Return whether the lever is pressed now; the board's debounce of 5 ms is shorter than one scan."""
        if self.is_unplugged:
            return SwitchState.UNKNOWN
        return SwitchState.CLOSED if self._world.is_switch_pressed() else SwitchState.OPEN
