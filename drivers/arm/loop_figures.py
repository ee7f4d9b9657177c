"""Timing figures of the arm's torque loop, as values; pure."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LoopFigures:
    """Timing of the torque loop over its last minute at most; s."""

    cycles: int
    """Number of control cycles since the arm was opened."""
    missed: int
    """Number of milliseconds of the arm's time without a received state, since it was opened."""
    success_rate: float
    """Share of the torques that arrived in time, as the arm reports it, mean since it was opened."""
    busy_median: float
    """Median time from a state's arrival to the torques' departure, s."""
    busy_p99: float
    busy_longest: float
    spacing_p99: float
    """Time between two states' arrivals, 99th percentile, s."""
    is_realtime: bool
    """True if the process has a real-time priority and locked memory."""
