"""The plate's surface: as the job states it, and as the sliding tip estimates it; pure."""

import math
from dataclasses import dataclass

import numpy as np

from drivers.frames import UP
from drivers.parts import Hole
from drivers.quantities import Vector

_ONE = np.eye(4)


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
    """Return the level plane through the hole's mouth as the job states it; it serves until a surface is estimated."""
    return Plane(np.array(hole.centre), UP)


class SurfaceEstimate:
    """Estimate of the plane on which the peg slides, by recursive least squares with forgetting; pure.

    The model is z = a + b x + c y + d s, with s = +-1 the sense of the path: friction tilts the hand a little, so
    that the height differs between the two senses. Without the slopes a tilted plate would look like an edge at
    every lane.
    """

    MEMORY = 200
    """Number of scans after which the weight of a height has fallen to 1/e; about three lanes."""
    NOISE = 4e-4
    """Standard deviation of the sliding tip's height about the plane, m, as if the scans erred independently.

    The height errs by 0.1 mm, mostly through theta, and therefore alike in the ten or more scans of one frame. The
    larger figure gives those scans together about the weight of a single one.
    """
    DOUBT = 5.0
    """Factor on the noise of a height more than three deviations below the plane, so that an edge hardly moves the plane."""
    SLOPE = 0.02
    """Standard deviation of the plate's slopes before anything is felt; slopes are clipped to three times as much."""

    HEIGHT = 1e-3
    """Standard deviation of the height before anything is felt, m; forgetting never lets it grow beyond this."""

    def __init__(self) -> None:
        """Start from a level plate of unknown height."""
        self._origin = np.zeros(2)
        self._values = np.zeros(4)
        self._doubt = np.array([self.HEIGHT, self.SLOPE, self.SLOPE, 2.0 * self.NOISE])
        self._covariance = np.diag(self._doubt**2)
        self._scans = 0

    def learn(self, edge: Vector, sense: int) -> None:
        """Update the estimate by the peg's lowest point `edge`, shape (3,), m, base frame, in a pass in `sense`, -1 or 1."""
        if self._scans == 0:
            self._origin, self._values[0] = np.array(edge[:2]), edge[2]
        row = self._row(edge, sense)
        towards = self._covariance @ row
        spread, above = float(row @ towards), float(edge[2] - row @ self._values)
        is_dip = self._scans > 0 and -above > 3.0 * math.sqrt(spread)
        noise = self.NOISE * (self.DOUBT if is_dip else 1.0)
        gain = towards / (noise**2 + spread)
        self._values = self._values + gain * above
        # Joseph's form keeps the covariance positive; the shorter form loses that to rounding.
        left = _ONE - gain[:, None] * row
        self._covariance = left @ self._covariance @ left.T + noise**2 * (gain[:, None] * gain)
        self._covariance *= 1.0 + 1.0 / self.MEMORY
        # Forgetting must not let the covariance grow beyond what was known at first.
        excess = np.minimum(self._doubt / np.sqrt(self._covariance.diagonal()), 1.0)
        self._covariance *= excess[:, None] * excess
        self._scans += 1

    def below(self, edge: Vector, sense: int) -> float:
        """Return the depth of the point `edge` below the plane less one standard deviation, m; 0 before the first update."""
        if self._scans == 0:
            return 0.0
        row = self._row(edge, sense)
        return self.dip(edge, sense) - math.sqrt(float(row @ self._covariance @ row))

    def dip(self, edge: Vector, sense: int) -> float:
        """Return the depth of the point `edge` below the plane as it is best known, m; 0 before the first update."""
        return float(self._row(edge, sense) @ self._values - edge[2]) if self._scans else 0.0

    @property
    def knows_slopes(self) -> bool:
        """Whether enough scans have told the slopes; until then the plane counts as level."""
        return self._scans >= self.MEMORY / 2

    def fallen(self, before: Vector, edge: Vector) -> float:
        """Return by how much a pass went down from the point `before` to the point `edge`, less what the slopes and one standard deviation of
        them explain, m.

        The height of the plane cancels, so that a plane of which little was felt yet tells a fall as well. Points have the shape (3,), m, base
        frame.
        """
        way = np.array([0.0, edge[0] - before[0], edge[1] - before[1], 0.0])
        return float(before[2] + way @ self._values - edge[2]) - math.sqrt(float(way @ self._covariance @ way))

    def plane(self, near: Vector) -> Plane:
        """Return the plane at `near`, shape (2,) or more, m, base frame; level until `MEMORY` / 2 scans have told its slopes."""
        slopes = np.clip(self._values[1:3], -3.0 * self.SLOPE, 3.0 * self.SLOPE)
        if not self.knows_slopes:
            slopes = np.zeros(2)
        slope: Vector = np.array([-slopes[0], -slopes[1], 1.0])
        height = self._values[:3] @ self._row(near, 0)[:3]
        return Plane(np.array([near[0], near[1], height]), slope / np.linalg.norm(slope))

    def _row(self, edge: Vector, sense: int) -> Vector:
        return np.array([1.0, edge[0] - self._origin[0], edge[1] - self._origin[1], sense])
