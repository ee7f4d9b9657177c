"""Hands that stop looking at their skin, for what touch is worth: theta is frozen after the grasp, or taken for 0."""

from dataclasses import replace

from cell.cell_config import CellConfig
from skills.tactile.blend import Smoothing
from skills.tactile.pose import NO_PEG, PegPose, Tracker

FIRST = 1.0
"""Time from the first healthy frame in which a frozen hand still takes frames, s: the fingers close and the peg is drawn from
its slot.
"""


class Frozen:
    """Takes the frames of a grasp as `Smoothing` does and holds theta from then on; the frames' stamps still count."""

    def __init__(self, smoothing: Smoothing) -> None:
        """Begin without an estimate."""
        self._smoothing, self._peg = smoothing, NO_PEG
        self._until = 0.0

    def follow(self, new: PegPose | None, stamp: float, moment: float) -> PegPose:
        """Return the pose of the peg now; see `Tracker`."""
        if new is None or new.stamp <= self._peg.stamp:
            return self._peg
        if not self._peg.healthy:
            self._until = new.stamp + FIRST
        taken = self._smoothing.take(self._peg, new)
        self._peg = taken if new.stamp <= self._until else replace(self._peg, stamp=new.stamp)
        return self._peg


class Straight:
    """Takes the peg to lie straight in the hand; the frames' stamps still count."""

    def __init__(self) -> None:
        """Begin without an estimate."""
        self._peg = NO_PEG

    def follow(self, new: PegPose | None, stamp: float, moment: float) -> PegPose:
        """Return the pose of the peg now; see `Tracker`."""
        if new is not None and new.stamp > self._peg.stamp:
            self._peg = replace(new, theta=0.0, offset=0.0)
        return self._peg


def frozen(config: CellConfig) -> Tracker:
    """Return the tracker of a hand that goes blind after the grasp."""
    return Frozen(config.smoothing)


def straight(config: CellConfig) -> Tracker:
    """Return the tracker of a hand that takes theta for 0."""
    return Straight()
