"""Histogram of the time between two reports of the cell; pure, time passed in."""

from bisect import bisect_left
from dataclasses import dataclass, field

BOUNDS = (0.002, 0.005, 0.0095, 0.0105, 0.012, 0.015, 0.02, 0.03, 0.05, 0.1, 0.2, 0.5)
"""Upper ends of the ranges, s, finest around the period of the usual scan; the last range has no upper end."""


@dataclass(slots=True)
class Intervals:
    """The intervals since the start."""

    counts: list[int] = field(default_factory=lambda: [0] * (len(BOUNDS) + 1))
    """Number of intervals in each range; a bound belongs to the range that it ends."""
    total: float = 0.0
    """Sum of the intervals, s."""
    longest: float = 0.0
    """Longest interval, s."""
    _last: float | None = None

    def note(self, now: float) -> None:
        """Record the time of a report, s."""
        if self._last is not None:
            interval = now - self._last
            self.counts[bisect_left(BOUNDS, interval)] += 1
            self.total += interval
            self.longest = max(self.longest, interval)
        self._last = now
