"""Theta, filtered from frame to frame and, between two frames, corrected for the twist of the peg by the moment on it."""

import math
from dataclasses import replace
from typing import Annotated, ClassVar

from pydantic import Field

from drivers.config_model import ConfigModel, Quantity, Source
from skills.tactile.pose import NO_PEG, PegPose
from skills.tactile.twist import GripTwist

FURTHEST = 2.0
"""Largest in-hand angle of a held peg, rad; at larger angles the peg would collide with the hand. Source: chosen, not measured."""


class Smoothing(ConfigModel):
    """Filter of theta from frame to frame."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    jump: Annotated[float, Field(gt=0.0), Quantity("rad"), Source("docs/tried/angle.md")] = 0.15
    """Largest difference of a frame from the running estimate that is accepted at once, rad. A larger difference is a jump: it is accepted only
    if the next frame jumps to the same side, too. No held peg turns so far between two frames. A value above pi/2 accepts every frame at once,
    as in [gibbons].
    """
    softest: Annotated[float, Field(ge=0.0, le=10.0), Quantity("rad/(N·m)"), Source("assumed")] = 1.9
    """Twist of the peg in the softest pads by a moment about the closing axis, rad/(N·m); 0 holds theta between frames, as
    [gibbons] does. Two pads of shear stiffness k and length l twist by 12/(k l²), here 5 kN/m and 36 mm.
    """

    def take(self, held: PegPose, new: PegPose) -> PegPose:
        """Return the running estimate after a new healthy frame.

        A peg that is turned by 180 degrees gives the same frame. Of the two possible angles, the one nearer to the present estimate is used. If
        that angle exceeds `FURTHEST`, the present estimate was wrong, from a frame of closing fingers: the angle of the new frame is used
        unchanged.
        """
        if not held.healthy:
            return new
        step = _step(held, new)
        if abs(held.theta + step) > FURTHEST:
            return new
        return PegPose(held.theta + step, new.offset, new.sigma, new.residual, True, new.stamp)

    def jump_of(self, held: PegPose, new: PegPose) -> float:
        """Return the difference of a new healthy frame from the running estimate, rad; 0 if it is not a jump."""
        step = _step(held, new) if held.healthy else 0.0
        return step if abs(step) > self.jump else 0.0


def _step(held: PegPose, new: PegPose) -> float:
    """Return the smallest rotation from one angle to another, rad; angles that differ by 180 degrees are equal."""
    return math.remainder(new.theta - held.theta, math.pi)


class Blend:
    """Filters the estimates of frames by `Smoothing`, and twists theta between frames; a single frame cannot make theta jump."""

    def __init__(self, smoothing: Smoothing) -> None:
        """Start without any estimate."""
        self._smoothing, self._peg = smoothing, NO_PEG
        self._jump = 0.0
        """Jump of the newest frame, rad; 0 if the frame did not jump."""
        self._twist, self._moment = GripTwist(smoothing.softest), 0.0
        """Compliance of the grip, and the moment at the time of the frame in use, N·m."""

    def follow(self, new: PegPose | None, stamp: float, moment: float) -> PegPose:
        """Return the pose of the peg now; see `Tracker`."""
        self._twist.moments.append((stamp, moment))
        if new is not None and new.stamp > self._peg.stamp:
            then = self._twist.moment(new.stamp)
            held, change = self._twisted(then), then - self._moment
            before, self._jump = self._jump, self._smoothing.jump_of(held, new)
            if self._jump == 0.0 or before * self._jump > 0.0:
                if held.healthy and self._jump == 0.0:
                    self._twist.learn(change, _step(self._peg, new))
                self._peg, self._moment = self._smoothing.take(held, new), then
            else:
                self._peg = replace(self._peg, stamp=new.stamp)
        return self._twisted(moment)

    def _twisted(self, moment: float) -> PegPose:
        """Return the present pose under another moment, N·m."""
        # theta = theta_frame + c (M - M_frame)
        peg, turn = self._peg, self._twist.compliance * (moment - self._moment)
        if not peg.healthy or not turn:
            return peg
        # `dataclasses.replace` would take five times as long, at every scan.
        return PegPose(peg.theta + turn, peg.offset, peg.sigma, peg.residual, True, peg.stamp)
