"""How far gains are from where the loop through the skin would go unstable, by theory, at the arm's own inertia.

The theory is that of an error as old as the skin's last frame, used at once: the most that a controller may be asked
for which knows nothing between two frames. The law of the arm knows more; `cell study stability` shows how much.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cell.sampled_loop import largest_factor, one_period, radius
from drivers.arm.inertia import tip_inertia
from drivers.arm.kinematics import joints_at
from drivers.arm.model import ArmModel
from drivers.part.contract import Part
from drivers.quantities import Vector
from skills.motion import Gains

MARGIN = 1.2
"""A gain must stay stable when it is so many times as large, its damping as it is."""
HELD: dict[str, Vector] = {
    "translation": np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]),
    "rotation": np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]),
}
"""Whose error is as old as the frame, shape (6, 6); the other's is as it is now."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where and how the arm works with a steered peg: the peg's end in the middle of the hole's area."""

    arm: ArmModel
    tip: tuple[float, float, float]
    """End point of the peg, m, base frame."""
    part: Part
    """Cross-section of the peg, which decides over what it leans."""
    lean: float
    """Azimuth of the closing axis in the search, were the peg upright, rad."""
    tilt: float
    """Tilt of the peg from the vertical in the search, rad; after it the peg is upright."""
    elbow: float
    """Position that the elbow's joint is drawn to, rad."""
    length: float
    """Distance from the finger centre to the peg's end, m."""

    def is_within_reach(self) -> bool:
        """Whether the arm reaches it with the peg tilted and upright."""
        return all(_joints(self, tilt) is not None for tilt in (self.tilt, 0.0))


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


def margins(gains: Gains, rate: float, place: Place) -> tuple[Margin, ...]:
    """Return the margins of translation and rotation with `rate` frames a second, Hz, at a place within reach."""
    return tuple(_margin(kind, gains, rate, place) for kind in HELD)


def too_high(gains: Gains, rate: float, place: Place) -> Margin | None:
    """Return what has less than the MARGIN, or None; the place must be within reach."""
    for kind in HELD:
        if not all(radius(one_period(*loop, 1.0 / rate, 0.0)) < 1.0 for loop in _loops(kind, gains, MARGIN, place)):
            return _margin(kind, gains, rate, place)
    return None


def _margin(kind: str, gains: Gains, rate: float, place: Place) -> Margin:
    factor = min(largest_factor(*loop, 1.0 / rate, 0.0) for loop in _loops(kind, gains, 1.0, place))
    gain: float = getattr(gains, kind)
    return Margin(kind, gain, factor * gain)


def _loops(kind: str, gains: Gains, factor: float, place: Place) -> Iterator[tuple[Vector, Vector, Vector, Vector]]:
    stiffness, damping, held = np.diag(gains.stiffness()), np.diag(gains.damping()), HELD[kind]
    for inertia in inertias(place):
        yield inertia, factor * held @ stiffness, stiffness - held @ stiffness, damping


@lru_cache(maxsize=64)
def inertias(place: Place) -> tuple[Vector, Vector]:
    """Return the arm's inertia at the peg's end with the peg tilted and upright, each shape (6, 6)."""
    tilted_peg, upright = (_joints(place, tilt) for tilt in (place.tilt, 0.0))
    assert tilted_peg is not None
    assert upright is not None
    return tip_inertia(place.arm, tilted_peg, place.length), tip_inertia(place.arm, upright, place.length)


@lru_cache(maxsize=64)
def _joints(place: Place, tilt: float) -> Vector | None:
    axis, closing = place.part.leaning(place.lean, tilt)
    return joints_at(place.arm, np.array(place.tip), axis, closing, place.length, place.elbow)
