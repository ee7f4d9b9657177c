"""The path of the printed search; a pure function of time."""

import math
from dataclasses import dataclass

import numpy as np

from drivers.quantities import Vector


@dataclass(frozen=True, slots=True)
class SprayPaint:
    """Spray-paint path over a rectangle: one sinusoid for each axis, [gibbons], Sec. IV and [chhatpar].

    x = a_x sin(w_x t + p_x), y = a_y sin(w_y t + p_y), with one fast and one slow axis. Neighbouring passes are
    furthest apart at the turning points of the fast axis, in the middle of the slow axis. Their distance there is the
    slow axis' travel in one fast period, the pitch 2 pi a_slow w_slow / w_fast.
    """

    half: tuple[float, float]
    """Half the extents of the rectangle, m."""
    rate: tuple[float, float]
    """Angular rates, rad/s."""
    phase: tuple[float, float]
    """Phases at time 0, rad."""

    def at(self, time: float) -> tuple[Vector, Vector]:
        """Return the point, m, relative to the middle of the rectangle, and its velocity, m/s, at `time`, each shape (2,)."""
        (ax, ay), (wx, wy), (px, py) = self.half, self.rate, self.phase
        x, y = wx * time + px, wy * time + py
        return (
            np.array([ax * math.sin(x), ay * math.sin(y)]),
            np.array([ax * wx * math.cos(x), ay * wy * math.cos(y)]),
        )


def spray_paint(
    half: tuple[float, float], pitch: float, speed: float, fast: int, start: tuple[float, float]
) -> SprayPaint:
    """Return a path that starts at `start`, drifts along the slow axis to the nearer edge and then covers the whole rectangle.

    Args:
        half: Half the extents, m, > 0.
        pitch: Largest distance between neighbouring passes, m.
        speed: Peak speed along the fast axis, m/s.
        fast: Axis that is swept fast, 0 or 1.
        start: First point, m, relative to the middle of the rectangle and within it.
    """
    # w_fast = speed / a_fast; pitch = 2 pi a_slow w_slow / w_fast, solved for w_slow; p = arcsin(start / a)
    slow = 1 - fast
    rates = [0.0, 0.0]
    rates[fast] = speed / half[fast]
    rates[slow] = pitch * rates[fast] / (2.0 * math.pi * half[slow])
    phases = [math.asin(min(max(s / h, -1.0), 1.0)) for s, h in zip(start, half, strict=True)]
    if start[slow] < 0.0:
        phases[slow] = math.pi - phases[slow]
    return SprayPaint(half, (rates[0], rates[1]), (phases[0], phases[1]))
