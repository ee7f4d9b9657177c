"""How far gains are from where the loop through the skin would go unstable, by theory, at the arm's own inertia.

The theory is that of an error as old as the skin's last frame, used at once: the most that a controller may be asked
for which knows nothing between two frames. The law of the arm knows more; `cell study stability` shows how much.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cell.sampled_loop import largest_factor, one_period, radius
from drivers.quantities import Vector
from sim.tip_inertia import tip_inertia
from skills.motion import Gains

POSES: dict[str, Vector] = {
    "tilted": np.array([-0.132, 0.649, 0.140, -1.621, -0.034, 1.530, -0.740]),
    "upright": np.array([-0.073, 0.213, 0.110, -2.370, -0.440, 2.519, -0.343]),
}
"""Joint positions in the middle of the shipped hole's area, rad: peg tilted by 45 degrees as in the search, and upright."""
LENGTH = 0.05
"""Of the peg, m; [gibbons], Sec. VI."""
MARGIN = 1.2
"""A gain must stay stable when it is so many times as large, its damping as it is."""
HELD: dict[str, Vector] = {
    "translation": np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]),
    "rotation": np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]),
}
"""Whose error is as old as the frame, shape (6, 6); the other's is as it is now."""


@dataclass(frozen=True, slots=True)
class Margin:
    """One gain and its limit."""

    kind: str
    """`translation` or `rotation`."""
    gain: float
    """N/m or N·m/rad."""
    limit: float
    """First unstable gain, its damping as it is, the lower of the poses'."""

    @property
    def factor(self) -> float:
        """By how much the gain may be multiplied."""
        return self.limit / self.gain


def margins(gains: Gains, rate: float) -> tuple[Margin, ...]:
    """Return the margins of translation and rotation with `rate` frames a second, Hz."""
    return tuple(_margin(kind, gains, rate) for kind in HELD)


def too_high(gains: Gains, rate: float) -> Margin | None:
    """Return what has less than the MARGIN, or None."""
    for kind in HELD:
        if not all(radius(one_period(*loop, 1.0 / rate, 0.0)) < 1.0 for loop in _loops(kind, gains, MARGIN)):
            return _margin(kind, gains, rate)
    return None


def _margin(kind: str, gains: Gains, rate: float) -> Margin:
    factor = min(largest_factor(*loop, 1.0 / rate, 0.0) for loop in _loops(kind, gains, 1.0))
    gain: float = getattr(gains, kind)
    return Margin(kind, gain, factor * gain)


def _loops(kind: str, gains: Gains, factor: float) -> Iterator[tuple[Vector, Vector, Vector, Vector]]:
    stiffness, damping, held = np.diag(gains.stiffness()), np.diag(gains.damping()), HELD[kind]
    for name in POSES:
        yield inertia(name), factor * held @ stiffness, stiffness - held @ stiffness, damping


@lru_cache
def inertia(pose: str) -> Vector:
    """Return the arm's inertia at the tip in one of the POSES, shape (6, 6)."""
    return tip_inertia(POSES[pose], LENGTH)
