"""Hands without touch: theta is frozen after the grasp, or assumed to be 0."""

from dataclasses import replace

from cell.devices.assembly import Cell
from cell.lab.trials import NoProbe, Probe
from skills.contract import SkillContext
from skills.tactile.blend import Smoothing
from skills.tactile.pose import NO_PEG, PegPose

FIRST = 1.0
"""Time after the first healthy frame in which a frozen hand still accepts frames, s: the fingers close and the peg
leaves its slot."""


class Frozen:
    """Accepts the frames of a grasp as `Smoothing` does and holds theta afterwards; the frames' stamps stay in use."""

    def __init__(self, smoothing: Smoothing) -> None:
        """Begin without an estimate."""
        self._smoothing, self._peg = smoothing, NO_PEG
        self._until = 0.0

    def follow(self, new: PegPose | None, stamp: float, moment: float) -> PegPose:
        """Return the present pose of the peg; see `Tracker`."""
        if new is None or new.stamp <= self._peg.stamp:
            return self._peg
        if not self._peg.healthy:
            self._until = new.stamp + FIRST
        taken = self._smoothing.take(self._peg, new)
        self._peg = taken if new.stamp <= self._until else replace(self._peg, stamp=new.stamp)
        return self._peg


class Straight:
    """Assumes a straight peg in the hand; the frames' stamps stay in use."""

    def __init__(self) -> None:
        """Begin without an estimate."""
        self._peg = NO_PEG

    def follow(self, new: PegPose | None, stamp: float, moment: float) -> PegPose:
        """Return the present pose of the peg; see `Tracker`."""
        if new is not None and new.stamp > self._peg.stamp:
            self._peg = replace(new, theta=0.0, offset=0.0)
        return self._peg


def frozen(cell: Cell, ctx: SkillContext) -> Probe:
    """Take touch from a hand after the grasp."""
    ctx.perception = replace(ctx.perception, tracker=Frozen(cell.config.smoothing))
    return NoProbe()


def straight(cell: Cell, ctx: SkillContext) -> Probe:
    """Let a hand assume theta = 0."""
    ctx.perception = replace(ctx.perception, tracker=Straight())
    return NoProbe()
