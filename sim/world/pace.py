"""Simulated time, counted in ticks of the physics, and its pace relative to the wall clock."""

import time
from typing import Literal


class ClockPace:
    """Clock of a simulated cell."""

    def __init__(self, timestep: float, pace: float | Literal["max"]) -> None:
        """Start at time 0.

        Args:
            timestep: Length of a tick, s.
            pace: Multiple of real time, or "max".
        """
        self.timestep = timestep
        self.ticks = 0
        self.stamp = 0.0
        """Simulated time, s."""
        self._pace = pace
        self._wall: float | None = None

    def now(self) -> float:
        """Return the simulated time, s."""
        return self.stamp

    def tick(self, ticks: int) -> None:
        """Advance simulated time by a number of ticks."""
        self.ticks += ticks
        self.stamp = self.ticks * self.timestep

    def keep(self) -> None:
        """Wait until the wall clock has reached simulated time; no wait at pace "max"."""
        if self._pace == "max":
            return
        now, simulated = time.monotonic(), self.stamp / self._pace
        if self._wall is None:
            self._wall = now - simulated
        behind = self._wall + simulated - now
        if behind > 0.0:
            time.sleep(behind)
        else:
            # If the computer is too slow for the pace, the lost time is not recovered.
            self._wall = now - simulated
