"""The plate as the sliding tip feels it; pure."""

import math
from dataclasses import dataclass

import numpy as np

from drivers.frames import UP
from drivers.parts import Hole
from drivers.quantities import Vector

_ONE = np.eye(4)


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """The plate's surface."""

    point: Vector
    """On it, shape (3,), m, base frame."""
    normal: Vector
    """Unit, shape (3,), base frame."""

    def depth(self, tip: Vector) -> float:
        """Return how far `tip`, shape (3,), m, base frame, lies below the surface, m."""
        return float(self.normal @ (self.point - tip))


def nominal(hole: Hole) -> Plane:
    """Return the level surface that the job says, for want of a better."""
    return Plane(np.array(hole.centre), UP)


class Ground:
    """The plane on which the peg slides, learnt on the way by least squares that forget; pure.

    z = a + b x + c y + d s, with s = +-1 the sense of the path: friction tilts the hand a little, so that the
    height differs between the two. A tilted plate would else look like an edge at every lane.
    """

    MEMORY = 200
    """Scans after which a height counts by 1/e: three lanes or so."""
    NOISE = 4e-4
    """Standard deviation of the sliding tip's height about the plane, m, as if every scan erred by itself.

    It errs by 0.1 mm, mostly as theta does, so alike in the ten and more scans of a frame: what is believed of one.
    """
    DOUBT = 5.0
    """A height that lies below what three deviations explain has so many times the noise: an edge is no plane."""
    SLOPE = 0.02
    """Standard deviation of the plate's slopes before anything is known; three times as much is taken for no plate."""

    HEIGHT = 1e-3
    """Most that the height may be in doubt, m."""

    def __init__(self) -> None:
        """Know nothing but that the plate is about level."""
        self._origin = np.zeros(2)
        self._values = np.zeros(4)
        self._doubt = np.array([self.HEIGHT, self.SLOPE, self.SLOPE, 2.0 * self.NOISE])
        self._covariance = np.diag(self._doubt**2)
        self._scans = 0

    def learn(self, edge: Vector, sense: int) -> None:
        """Take the lowest point of the sliding peg, shape (3,), m, in one scan of a pass in `sense`, -1 or 1."""
        if self._scans == 0:
            self._origin, self._values[0] = np.array(edge[:2]), edge[2]
        row = self._row(edge, sense)
        towards = self._covariance @ row
        spread, above = float(row @ towards), float(edge[2] - row @ self._values)
        is_dip = self._scans > 0 and -above > 3.0 * math.sqrt(spread)
        noise = self.NOISE * (self.DOUBT if is_dip else 1.0)
        gain = towards / (noise**2 + spread)
        self._values = self._values + gain * above
        # Joseph's form keeps the covariance positive where the plain one loses it to rounding.
        left = _ONE - gain[:, None] * row
        self._covariance = left @ self._covariance @ left.T + noise**2 * (gain[:, None] * gain)
        self._covariance *= 1.0 + 1.0 / self.MEMORY
        # What is forgotten must not grow beyond what was known at first.
        excess = np.minimum(self._doubt / np.sqrt(self._covariance.diagonal()), 1.0)
        self._covariance *= excess[:, None] * excess
        self._scans += 1

    def below(self, edge: Vector, sense: int) -> float:
        """Return how far that point lies below the plane, less one deviation of what is known of it, m; 0 before any is."""
        if self._scans == 0:
            return 0.0
        row = self._row(edge, sense)
        return float(row @ self._values - edge[2]) - math.sqrt(float(row @ self._covariance @ row))

    def plane(self, near: Vector) -> Plane:
        """Return the surface next to `near`, shape (2,) or more, m; level before a second of sliding has told its slopes."""
        slopes = np.clip(self._values[1:3], -3.0 * self.SLOPE, 3.0 * self.SLOPE)
        if self._scans < self.MEMORY / 2:
            slopes = np.zeros(2)
        slope: Vector = np.array([-slopes[0], -slopes[1], 1.0])
        height = self._values[:3] @ self._row(near, 0)[:3]
        return Plane(np.array([near[0], near[1], height]), slope / np.linalg.norm(slope))

    def _row(self, edge: Vector, sense: int) -> Vector:
        return np.array([1.0, edge[0] - self._origin[0], edge[1] - self._origin[1], sense])
