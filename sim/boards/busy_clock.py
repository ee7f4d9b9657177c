"""The cell's clock on a busy computer: some waits end late."""

import numpy as np

from drivers.protocols import Clock
from sim.world.reality import Drawn


class BusyClock:
    """Ends a wait late with a given probability; the delay is exponentially distributed, and simulated time advances during it."""

    def __init__(self, clock: Clock, drawn: Drawn, rng: np.random.Generator) -> None:
        """Store the clock, and the probability and mean of the delay; `rng` draws both."""
        self._clock, self._rng = clock, rng
        self.now = clock.now
        """Returns the simulated time, s."""
        self._probability, self._delay = float(drawn["scan.late"]), float(drawn["scan.delay"])

    def wait_until(self, stamp: float) -> None:
        """Wait until `stamp`, sometimes longer; return at once if it has passed."""
        is_late = self._rng.uniform() < self._probability
        self._clock.wait_until(stamp + (self._rng.exponential(self._delay) if is_late else 0.0))
