"""Simulated time, counted in ticks of the physics, and its pace beside the wall clock."""

import time
from typing import Literal


class Pace:
    """Time of a simulated world."""

    def __init__(self, timestep: float, pace: float | Literal["max"]) -> None:
        """Start at 0.

        Args:
            timestep: Length of a tick, s.
            pace: Multiple of real time to keep to, or "max".
        """
        self.timestep = timestep
        self.ticks = 0
        self._pace = pace
        self._wall: float | None = None

    def now(self) -> float:
        """Return the simulated time, s."""
        return self.ticks * self.timestep

    def ticks_until(self, stamp: float) -> int:
        """Return the number of ticks from now to a time, s."""
        return round((stamp - self.now()) / self.timestep)

    def keep(self) -> None:
        """Wait until the wall clock has come as far as simulated time; never at pace "max"."""
        if self._pace == "max":
            return
        now, simulated = time.monotonic(), self.now() / self._pace
        if self._wall is None:
            self._wall = now - simulated
        behind = self._wall + simulated - now
        if behind > 0.0:
            time.sleep(behind)
        else:
            # A computer too slow for the pace does not make up for lost time.
            self._wall = now - simulated
