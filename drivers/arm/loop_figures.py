"""Figures of the arm's torque loop, as values; pure."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from drivers.quantities import Vector

PRIORITY = 80
"""Priority of the loop under SCHED_FIFO, if permitted."""


@dataclass(frozen=True, slots=True)
class Times:
    """Percentiles of a time of the loop, s."""

    p50: float
    p99: float
    p999: float
    largest: float

    @classmethod
    def of(cls, times: Vector) -> Self:
        """Return the percentiles of `times`, shape (n,), s."""
        return cls(*(float(value) for value in np.percentile(times, (50.0, 99.0, 99.9, 100.0))))


@dataclass(frozen=True, slots=True)
class LoopFigures:
    """Timing of the torque loop over at most its last ten minutes, and the masses that the arm reports."""

    cycles: int
    """Number of control cycles since the arm was opened."""
    missed: int
    """Number of milliseconds of the arm's time without a received state, since it was opened."""
    success_rate: float
    """Share of the torques that arrived in time, as the arm reports it, mean since it was opened."""
    busy: Times
    """Time from a state's arrival to the torques' departure."""
    spacing: Times
    """Time between two states' arrivals."""
    is_realtime: bool
    """True if the process has a real-time priority and locked memory."""
    end_effector: float
    """Mass of the end effector as set in the arm's controller, kg."""
    load: float
    """Mass of the load as set in the arm's controller, kg."""
