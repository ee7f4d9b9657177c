"""The simulated switch under the hole as a SuccessSwitch."""

from typing import Protocol

from drivers.quantities import SwitchState


class SwitchSource(Protocol):
    """Interface of the physics to the switch under the hole."""

    def now(self) -> float:
        """Return the time, s."""

    def is_switch_pressed(self) -> bool:
        """True if the lever is pressed."""


class SimSwitch:
    """Closes when the peg's end reaches the seated depth."""

    def __init__(self, world: SwitchSource) -> None:
        """Attach to the physics of the cell with the hole."""
        self._world = world
        self.is_unplugged = False
        """True if the board's cable is unplugged."""

    def open(self) -> None:
        """Do nothing: there is no connection."""

    def close(self) -> None:
        """Do nothing: there is no connection."""

    def read(self) -> SwitchState:
        """Return True if the lever is pressed now.

        The board's debounce of 5 ms is shorter than one scan.
        """
        if self.is_unplugged:
            return SwitchState.UNKNOWN
        return SwitchState.CLOSED if self._world.is_switch_pressed() else SwitchState.OPEN
