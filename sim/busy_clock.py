"""The cell's clock on a busy computer, on which a wait now and then ends late."""

import numpy as np

from drivers.protocols import Clock
from sim.reality import Drawn


class BusyClock:
    """Wakes late with some probability, by a time that is exponentially distributed; simulated time goes on meanwhile."""

    def __init__(self, clock: Clock, drawn: Drawn, rng: np.random.Generator) -> None:
        """Keep the clock that is waited for, and how often and by how much waits end late; `rng` draws both."""
        self._clock, self._rng = clock, rng
        self._probability, self._delay = float(drawn["scan.late"]), float(drawn["scan.delay"])

    def now(self) -> float:
        """Return the simulated time, s."""
        return self._clock.now()

    def wait_until(self, stamp: float) -> None:
        """Wait until `stamp`, at times a little longer; return at once when it has passed."""
        is_late = self._rng.uniform() < self._probability
        self._clock.wait_until(stamp + (self._rng.exponential(self._delay) if is_late else 0.0))
