"""How the arm's torque loop kept its time, as values; pure."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LoopFigures:
    """How the torque loop kept its time, over its last minute at most; s."""

    cycles: int
    """Number of control cycles since the arm was opened."""
    missed: int
    """Milliseconds of the arm's time that went by without a state here, since it was opened."""
    success_rate: float
    """Share of the torques that the arm says came in time, mean since it was opened."""
    busy_median: float
    """Median time from a state's arrival to the torques' departure, s."""
    busy_p99: float
    busy_longest: float
    spacing_p99: float
    """Time between two states' arrivals, 99th percentile, s."""
    is_realtime: bool
    """The process has a real-time priority and its memory is locked."""
