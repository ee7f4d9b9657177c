"""Peg guided by the hole: its depth, descent and aim, and the motions that free it if it jams; pure."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from drivers.frames import end_point
from drivers.quantities import InHandTip, Pose, Vector
from skills.insert.spiral_params import SpiralAdjustParams
from skills.motion import tilted_by
from skills.paths import dither


@dataclass(frozen=True, slots=True)
class Stall:
    """Largest depth of the peg and its time; pure."""

    deepest: float = -math.inf
    """Largest depth that counted as progress, m."""
    since: float = 0.0
    """Running time at which the peg reached that depth, s."""

    def after(self, depth: float, elapsed: float, least: float) -> "Stall":
        """Return the stall after a scan at `depth`, m; a depth counts as progress if it exceeds the largest by `least`, m."""
        return Stall(depth, elapsed) if depth > self.deepest + least else self

    def measured_anew(self, depth: float, before: float) -> "Stall":
        """Return the stall after a new theta has changed the depth of the same tip from `before` to `depth`, m."""
        return replace(self, deepest=self.deepest + depth - before)


@dataclass(frozen=True, slots=True)
class Descent:
    """Smoothed speed of the tip down the hole; pure."""

    depth: float
    """Depth of the tip at the last scan, m."""
    speed: float = 0.0
    """Speed down the hole, m/s, >= 0."""

    def after(self, depth: float, period: float, params: SpiralAdjustParams) -> "Descent":
        """Return the descent after a scan at `depth`, m, `period` seconds after the last one."""
        # v <- v + smoothing (max(delta d, 0) / period - v)
        speed = max(depth - self.depth, 0.0) / period
        return Descent(depth, self.speed + params.smoothing * (speed - self.speed))

    def rest(self, params: SpiralAdjustParams) -> float:
        """Return the share of rest: 1 if the tip stands still, 0 if it slides at `sliding` or faster."""
        return max(1.0 - self.speed / params.sliding, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Aim:
    """Assumed pose of the peg in the hand, and the direction of the push.

    Theta is updated only if the peg jams: fed back at every frame, it would drift with its bias.
    """

    in_hand: InHandTip
    direction: Vector
    """Axis of the peg without dither or sweep, from its end upwards, unit, shape (3,), base frame."""
    is_by_plate: bool = True
    """True if the direction is the plate's normal, False if it is the axis of the peg resting in the hole."""

    def tip(self, tcp: Pose) -> Vector:
        """Return the end point of the peg, shape (3,), m, base frame."""
        return end_point(tcp, self.in_hand.theta, self.in_hand.length)[0]

    def axis(self, offset: Vector) -> Vector:
        """Return the axis of the peg, unit, shape (3,), with the finger centre at `offset`, shape (2,), m, from `direction`."""
        return tilted_by(offset + self.in_hand.length * self.direction[:2], self.in_hand.length)

    def kept(self, tcp: Pose) -> "Aim":
        """Return the aim along the peg's present axis, so that the hand keeps its orientation."""
        return replace(self, direction=end_point(tcp, self.in_hand.theta, self.in_hand.length)[1])

    def freed(self, in_hand: InHandTip, tcp: Pose, normal: Vector) -> "Aim":
        """Return the aim after a jam, with the newly measured theta.

        The direction alternates between the plate's normal and the axis of the resting peg. If the search covered little
        of the plate, the resting peg measures the hole's axis better than the surface estimate.
        """
        _, resting = end_point(tcp, in_hand.theta, in_hand.length)
        return Aim(in_hand, resting, False) if self.is_by_plate else Aim(in_hand, normal, True)


@dataclass(frozen=True, slots=True, eq=False)
class TiltSweep:
    """Swing of the hand about its closing axis to both sides; it moves a peg in two-point contact through the hole's axis; pure.

    An error of theta tilts the aim in the plane in which the peg pivots between the pads. The error is at most the lean
    that the walls allow at the peg's depth; its sign is unknown. On the wrong side, the peg pivots in the hand and the
    force stays small.
    """

    began: float = -math.inf
    """Running time at which the sweep started, s."""
    amplitude: float = 0.0
    """Largest offset of the finger centre, m; its sign gives the first side."""
    direction: Vector = field(default_factory=lambda: np.zeros(2))
    """Direction of the offset, unit, shape (2,), base frame."""

    def is_on(self, elapsed: float, params: SpiralAdjustParams) -> bool:
        """Return True if the sweep is active `elapsed` seconds after the start of the adjustment."""
        return elapsed - self.began < params.sweep_time

    def next(self, elapsed: float, tcp: Pose, tilt: float, length: float, params: SpiralAdjustParams) -> "TiltSweep":
        """Return a new sweep that starts now, first to the side opposite to the last sweep's.

        Args:
            elapsed: Running time, s.
            tcp: Pose of the hand, T_base_tcp.
            tilt: Largest lean that the hole allows the peg at its depth, rad.
            length: Length of the peg from its end to the finger centre, m.
            params: Angles of the sweep.
        """
        across = tcp.rotation[:2, 1]
        amplitude = length * min(tilt + params.swept_beyond, params.most_swept)
        return TiltSweep(
            elapsed, -math.copysign(amplitude, self.amplitude), across / max(float(np.linalg.norm(across)), 1e-9)
        )

    def offset(self, elapsed: float, params: SpiralAdjustParams) -> Vector:
        """Return the offset of the finger centre from the line of the aim, shape (2,), m."""
        # amplitude · sin(2 pi t / sweep_time)
        turned = 2.0 * math.pi * (elapsed - self.began) / params.sweep_time
        return self.amplitude * math.sin(turned) * self.direction


@dataclass(frozen=True, slots=True)
class Guide:
    """Depth gained in each period of the dither; pure."""

    began: float = 0.0
    """Running time at which the dither began, s."""
    periods: int = 0
    """Number of completed periods of the dither."""
    reached: float = 0.0
    """Depth at the end of the last period, m."""
    is_jammed: bool = False
    """True if a period ended in this scan and the peg stood still or crept during it."""

    def after(self, depth: float, elapsed: float, params: SpiralAdjustParams) -> "Guide":
        """Return the guide after a scan at `depth`, m, `elapsed` seconds after the start of the adjustment."""
        if int((elapsed - self.began) / params.dither_period) <= self.periods:
            return replace(self, is_jammed=False) if self.is_jammed else self
        is_jammed = depth - self.reached < params.creep * params.jammed
        return Guide(self.began, self.periods + 1, depth, is_jammed)

    def offset(self, elapsed: float, params: SpiralAdjustParams, share: float) -> Vector:
        """Return the offset of the finger centre from the line of the aim, shape (2,), m.

        Args:
            elapsed: Running time, s.
            params: Sizes and rates of the dither.
            share: Factor on the dither's radius: 0 if the peg slides, 1 if it rests.
        """
        return dither(elapsed - self.began, share * params.dither_radius, params.dither_rate, params.dither_period)
