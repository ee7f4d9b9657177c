"""Pose of the peg in the hand: the value, the protocol of an estimator from one frame, and the protocol of a tracker."""

import math
from dataclasses import dataclass
from typing import Protocol

from drivers.quantities import TaxelFrame


@dataclass(frozen=True, slots=True)
class PegPose:
    """Estimate of the peg's pose in the hand."""

    theta: float
    """In-hand angle, rad, in [-pi/2, pi/2)."""
    offset: float
    """Signed distance of the peg's axis from the finger centre, m, in the plane of the pads."""
    sigma: float
    """Standard deviation of theta, rad."""
    residual: float
    """Share of the frame not explained by the estimate, 0 to 1."""
    healthy: bool
    """True if theta may be used."""
    stamp: float
    """Time of the frame on which the estimate is based, s."""


NO_PEG = PegPose(theta=0.0, offset=0.0, sigma=math.inf, residual=1.0, healthy=False, stamp=-math.inf)
"""Pose before the first healthy estimate: theta is 0 and `healthy` is False."""


class Estimator(Protocol):
    """Estimator of the peg's pose in the hand from single frames; it keeps only estimates about the pads between frames."""

    def estimate(self, frame: TaxelFrame) -> PegPose:
        """Return the pose of the peg in `frame`; `healthy` is False if the frame shows no peg."""


class Tracker(Protocol):
    """Tracker of the peg's pose in the hand, updated at every scan."""

    def follow(self, new: PegPose | None, stamp: float, moment: float) -> PegPose:
        """Return the present pose of the peg, at every scan; `healthy` is False until the first estimate.

        Args:
            new: Healthy estimate from a new frame; None if there is none. Its stamp can lie in the past. If it is not newer
                than the estimate in use, it is ignored.
            stamp: Time now, s.
            moment: Moment on the peg about the closing axis, N·m.
        """
