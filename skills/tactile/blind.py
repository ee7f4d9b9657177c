"""Theta of a cell that stops looking at its skin, for studies of what touch is worth; no recipe wants it."""

import math
from dataclasses import replace

from drivers.quantities import Pose
from skills.tactile.blend import Smoothing
from skills.tactile.pose import NO_PEG, PegPose

FIRST = 1.0
"""Time from the first healthy frame on in which a hand that goes blind after the grasp still takes frames, s: the fingers
close and the peg is drawn from its slot."""


class Blind:
    """Takes the frames of a grasp as `Smoothing` does and holds the last of them, or takes the peg to lie straight in the hand."""

    def __init__(self, smoothing: Smoothing) -> None:
        """Start without any estimate."""
        self._smoothing, self._peg = smoothing, NO_PEG
        self._until = math.nan

    def follow(self, stamp: float, tcp: Pose, length: float, new: PegPose | None) -> PegPose:
        """Return the pose of the peg now; see `Tracker`. The frames' stamps still count, so that only theta is blind."""
        if new is None or new.stamp <= self._peg.stamp:
            return self._peg
        if self._smoothing.method == "straight":
            self._peg = replace(new, theta=0.0, offset=0.0)
        elif not self._peg.healthy or new.stamp <= self._until:
            self._until = self._until if self._peg.healthy else new.stamp + FIRST
            self._peg = self._smoothing.take(self._peg, new)
        else:
            self._peg = replace(self._peg, stamp=new.stamp)
        return self._peg
