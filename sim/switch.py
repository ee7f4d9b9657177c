"""The simulated switch under the hole as a SuccessSwitch."""

from drivers.quantities import SwitchState
from sim.world import World


class SimSwitch:
    """Closes when the peg's end reaches the seated depth."""

    def __init__(self, world: World) -> None:
        """Attach to the world that has the hole."""
        self._world = world

    def open(self) -> None:
        """Nothing to connect."""

    def close(self) -> None:
        """Nothing to disconnect."""

    def read(self) -> SwitchState:
        """Return whether it is pressed now; the board's 5 ms debounce is below one scan."""
        return SwitchState.CLOSED if self._world.is_switch_pressed() else SwitchState.OPEN
