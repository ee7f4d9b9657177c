"""Plate's surface: nominal from the job, and estimated from the sliding tip; pure."""

import math
from dataclasses import dataclass

import numpy as np

from drivers.frames import UP
from drivers.parts import Hole
from drivers.quantities import Vector

_ONE = np.eye(3)


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """The plate's surface as a plane."""

    point: Vector
    """Point on the plane, shape (3,), m, base frame."""
    normal: Vector
    """Unit normal of the plane, away from the plate, shape (3,), base frame."""

    def depth(self, tip: Vector) -> float:
        """Return the depth of `tip`, shape (3,), m, base frame, below the surface along its normal, m."""
        return float(self.normal @ (self.point - tip))


def nominal(hole: Hole) -> Plane:
    """Return the level plane through the hole's mouth stated in the job, for use until a surface is estimated."""
    return Plane(np.array(hole.centre), UP)


class SurfaceEstimate:
    """Estimate of the plane on which the peg slides, by recursive least squares with forgetting; pure.

    The model is z = a + b x + c y. Without the slopes b and c, a tilted plate would resemble an edge at every lane.
    """

    MEMORY = 200
    """Number of scans after which the weight of a height has decreased to 1/e; about three lanes."""
    NOISE = 4e-4
    """Standard deviation of the sliding tip's height about the plane, m, for independent errors of the scans.

    The height has an error of 0.1 mm, mostly from theta. Ten or more scans use the same frame and have the same error. The
    larger value gives these scans together about the weight of one. Source: chosen, not measured.
    """
    DOUBT = 5.0
    """Factor on the noise of a height more than three deviations below the plane, so that an edge hardly moves the plane."""
    SLOPE = 5e-3
    """Prior standard deviation of the plate's slopes, rad. Source: largest tilt in config/reality.toml; reason in docs/tried/search.md."""

    HEIGHT = 1e-3
    """Prior standard deviation of the height, m; forgetting is limited to this value. Source: chosen, not measured."""

    def __init__(self) -> None:
        """Start from a level plate of unknown height."""
        self._origin = np.zeros(2)
        self._values = np.zeros(3)
        self._doubt = np.array([self.HEIGHT, self.SLOPE, self.SLOPE])
        self._covariance = np.diag(self._doubt**2)
        self._scans = 0

    def learn(self, edge: Vector) -> None:
        """Update the estimate with the peg's lowest point `edge`, shape (3,), m, base frame."""
        if self._scans == 0:
            self._origin, self._values[0] = np.array(edge[:2]), edge[2]
        row = self._row(edge)
        towards = self._covariance @ row
        spread, above = float(row @ towards), float(edge[2] - row @ self._values)
        is_dip = self._scans > 0 and -above > 3.0 * math.sqrt(spread)
        noise = self.NOISE * (self.DOUBT if is_dip else 1.0)
        # K = P r / (r^T P r + R), values <- values + K (z - r^T values), R = noise²
        gain = towards / (noise**2 + spread)
        self._values = self._values + gain * above
        # Joseph's form P <- (I - K r^T) P (I - K r^T)^T + R K K^T keeps the covariance positive despite rounding.
        left = _ONE - gain[:, None] * row
        self._covariance = left @ self._covariance @ left.T + noise**2 * (gain[:, None] * gain)
        self._covariance *= 1.0 + 1.0 / self.MEMORY
        # Forgetting must not increase a standard deviation beyond its prior value.
        excess = np.minimum(self._doubt / np.sqrt(self._covariance.diagonal()), 1.0)
        self._covariance *= excess[:, None] * excess
        self._scans += 1

    def below(self, edge: Vector) -> tuple[float, float]:
        """Return the depth of the point `edge` below the estimated plane, and the plane's standard deviation there, m; both 0 before
        the first update.
        """
        if self._scans == 0:
            return 0.0, 0.0
        row = self._row(edge)
        return float(row @ self._values - edge[2]), math.sqrt(float(row @ self._covariance @ row))

    @property
    def knows_slopes(self) -> bool:
        """True if enough scans have determined the slopes; until then the plane counts as level."""
        return self._scans >= self.MEMORY / 2

    def plane(self, near: Vector) -> Plane:
        """Return the plane at `near`, shape (2,) or more, m, base frame; level during the first `MEMORY` / 2 scans."""
        slopes = self._values[1:3] if self.knows_slopes else np.zeros(2)
        # Normal of z = a + b x + c y: [-b, -c, 1], normalized
        slope: Vector = np.array([-slopes[0], -slopes[1], 1.0])
        height = self._row(near) @ self._values
        return Plane(np.array([near[0], near[1], height]), slope / np.linalg.norm(slope))

    def _row(self, edge: Vector) -> Vector:
        return np.array([1.0, edge[0] - self._origin[0], edge[1] - self._origin[1]])
