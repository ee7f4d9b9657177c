"""Stability margins of gains in the loop through the skin, by theory, at the arm's own inertia.

The theory uses the error of the skin's last frame, without further delay. This is the bound for a controller without
information between two frames. The law of the arm has more information; `cell study stability` measures its margin.
"""

from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np

from cell.config.sampled_loop import Loop, largest_factor, one_period, radius
from drivers.arm.inertia import critical_damping, tip_inertia
from drivers.arm.kinematics import joints_at, largest_push
from drivers.arm.model import ArmModel
from drivers.part.contract import Part
from drivers.quantities import Vector
from skills.motion import Gains

MARGIN = 1.2
"""Least factor on a gain up to which the loop must be stable, ratio; the damping ratio is unchanged."""
HELD: dict[str, Vector] = {
    "translation": np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]),
    "rotation": np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]),
}
"""Projection on the directions with the error of the last frame, shape (6, 6); the other directions use the present error."""


@dataclass(frozen=True, slots=True)
class Place:
    """Place and attitude of the arm while the skin's measurement controls the peg, with its end at the centre of the hole's area."""

    arm: ArmModel
    tip: tuple[float, float, float]
    """End point of the peg, m, base frame."""
    part: Part
    """Cross-section of the peg; it decides the direction of the tilt."""
    tilt_azimuth: float
    """Azimuth of the closing axis in the search with an upright peg, rad."""
    tilt: float
    """Tilt of the peg from the vertical in the search, rad; after it the peg is upright."""
    elbow: float
    """Goal position of the elbow's joint, rad."""
    length: float
    """Distance from the finger centre to the peg's end, m."""

    def is_within_reach(self) -> bool:
        """True if the arm reaches the place with the peg tilted and upright."""
        return all(_joints(self, tilt) is not None for tilt in (self.tilt, 0.0))

    def postures(self) -> tuple[Vector, Vector]:
        """Return the joint positions, shape (7,), rad, with the peg tilted and upright; the place must be within reach."""
        tilted_peg, upright = (_joints(self, tilt) for tilt in (self.tilt, 0.0))
        assert tilted_peg is not None
        assert upright is not None
        return tilted_peg, upright

    def largest_push(self) -> float:
        """Return the largest vertical force of the arm with the peg upright, N; the place must be within reach."""
        return largest_push(self.arm, self.postures()[1], self.length)


@dataclass(frozen=True, slots=True)
class Margin:
    """One gain and its limit."""

    kind: str
    """Kind of the gain, `translation` or `rotation`."""
    gain: float
    """Gain in force, N/m or N·m/rad."""
    limit: float
    """First unstable gain with the damping ratio unchanged, the lower one of the two attitudes, N/m or N·m/rad."""


def too_high(gains: Gains, rate: float, place: Place) -> Margin | None:
    """Return the first margin below `MARGIN`, None if both are larger; the place must be within reach."""
    for kind in HELD:
        loops = (loop_at(kind, gains, inertia, MARGIN) for inertia in inertias(place))
        if not all(radius(one_period(*loop, 1.0 / rate, 0.0)) < 1.0 for loop in loops):
            return margin(kind, gains, rate, place)
    return None


def margin(kind: str, gains: Gains, rate: float, place: Place) -> Margin:
    """Return the margin of one kind of gain at a frame rate, Hz, at a place within reach."""
    limits = (largest_factor(partial(loop_at, kind, gains, inertia), 1.0 / rate, 0.0) for inertia in inertias(place))
    gain: float = getattr(gains, kind)
    return Margin(kind, gain, min(limits) * gain)


def loop_at(kind: str, gains: Gains, inertia: Vector, factor: float) -> Loop:
    """Return the loop with `factor` times one gain, its damping ratio unchanged, at an inertia of the tip."""
    raised = gains.model_copy(update={kind: factor * getattr(gains, kind)})
    stiffness, held = np.diag(raised.stiffness()), HELD[kind]
    damping = gains.damping_ratio * critical_damping(inertia, raised.stiffness())
    return inertia, held @ stiffness, stiffness - held @ stiffness, damping


@lru_cache(maxsize=64)
def inertias(place: Place) -> tuple[Vector, Vector]:
    """Return the arm's inertia at the peg's end with the peg tilted and upright, each shape (6, 6)."""
    tilted_peg, upright = place.postures()
    return tip_inertia(place.arm, tilted_peg, place.length), tip_inertia(place.arm, upright, place.length)


@lru_cache(maxsize=64)
def _joints(place: Place, tilt: float) -> Vector | None:
    axis, closing = place.part.leaning(place.tilt_azimuth, tilt)
    return joints_at(place.arm, np.array(place.tip), axis, closing, place.length, place.elbow)
