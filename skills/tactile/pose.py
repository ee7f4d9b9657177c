"""The pose of the peg in the hand: the value, the protocol that reads it from a frame, and the one that keeps it between frames."""

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
    """Distance of the peg's axis from the finger centre, in the plane of the pads, m, signed."""
    sigma: float
    """Standard deviation of theta, rad."""
    residual: float
    """Part of the frame that the estimate does not explain, 0 to 1."""
    healthy: bool
    """Whether theta may be used."""
    stamp: float
    """Time of the frame that the estimate was made from, s."""


NO_PEG = PegPose(theta=0.0, offset=0.0, sigma=math.inf, residual=1.0, healthy=False, stamp=-math.inf)
"""Pose before the first healthy estimate: straight out of the hand, and not healthy."""


class Estimator(Protocol):
    """Reads the pose of the peg in the hand from frames; an estimator remembers only what frames tell of the pads."""

    def estimate(self, frame: TaxelFrame) -> PegPose:
        """Return the pose of the peg in `frame`; `healthy` is False where the frame shows none."""


class Tracker(Protocol):
    """Keeps the pose of the peg in the hand from frame to frame, and between them."""

    def follow(self, new: PegPose | None, stamp: float, moment: float) -> PegPose:
        """Return the pose of the peg now, at every scan; not healthy as long as nothing is known.

        Args:
            new: Healthy estimate from a frame that has just come, if any. Its stamp may lie in the past; an estimate that is
                no newer than the one in use changes nothing.
            stamp: Time now, s.
            moment: Moment on the peg about the closing axis, N·m.
        """
