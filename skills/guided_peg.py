"""A peg that the hole guides: how deep it is, how fast it goes down, how it is aimed, and how it is freed where it jams; pure."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from drivers.frames import end_point
from drivers.quantities import InHandTip, Pose, Vector
from skills.motion import tilted_by
from skills.paths import dither, spiral
from skills.spiral_params import SpiralAdjustParams

SLIDING = 0.03
"""Speed of the tip along the hole from which on the peg is not dithered, m/s: friction of a peg that slides points against
its motion and not aside, so that nothing has to be freed, and a peg that is turned beyond its play while it goes down
strikes the wall.
"""
CREEP = 10.0
"""Multiple of `jammed` that a peg must gain in a period of the dither, or it is freed as one that stands still is: a peg that
is pushed along its hole gains fifty times as much, and one that wedges creeps. Source: docs/tried/adjustment.md."""
SWEPT_BEYOND = 0.015
"""Angle of a tilt sweep beyond the lean that the hole allows, rad: friction of the joints holds the hand off its aim by about as much. Source: decision
0105.
"""
MOST_SWEPT = 0.06
"""Largest angle of a tilt sweep, rad; a wider one turns pegs out of their holes. Source: docs/tried/adjustment.md."""
LET_GO = 0.5
"""Share of rest below which a swept peg slides, so that the hand stays as it is turned then, fraction."""
SMOOTHING = 0.3
"""Share of a new scan in the tip's speed: theta's noise moves the tip."""


@dataclass(frozen=True, slots=True)
class Stall:
    """The deepest place of the peg and the time since then; pure."""

    deepest: float = -math.inf
    """Depth that counts as reached, m."""
    since: float = 0.0
    """Time at which that depth was reached, as time of running, s."""

    def after(self, depth: float, elapsed: float, least: float) -> "Stall":
        """Return the stall after a scan at `depth`, m; only a depth that exceeds the deepest by `least`, m, counts as progress."""
        return Stall(depth, elapsed) if depth > self.deepest + least else self

    def measured_anew(self, depth: float, before: float) -> "Stall":
        """Return the stall where a new theta makes the depth of the same tip `depth` instead of `before`, m."""
        return replace(self, deepest=self.deepest + depth - before)


@dataclass(frozen=True, slots=True)
class Descent:
    """Speed at which the tip goes down the hole, smoothed; pure."""

    depth: float
    """Depth of the tip at the last scan, m."""
    speed: float = 0.0
    """Speed down the hole, m/s, >= 0."""

    def after(self, depth: float, period: float) -> "Descent":
        """Return the descent after a scan at `depth`, m, `period` seconds after the last one."""
        speed = max(depth - self.depth, 0.0) / period
        return Descent(depth, self.speed + SMOOTHING * (speed - self.speed))

    @property
    def rest(self) -> float:
        """Share of rest, 1 for a tip that stands still and 0 for one that slides at `SLIDING` or faster."""
        return max(1.0 - self.speed / SLIDING, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Aim:
    """How the peg is taken to lie in the hand, and along which direction it is pushed.

    Theta is frozen but where the peg jams: fed back at every frame it would follow its own bias.
    """

    in_hand: InHandTip
    direction: Vector
    """Axis of the peg about which the finger centre moves, unit, shape (3,), base frame."""
    is_by_plate: bool = True
    """Whether the direction is the plate's normal, and not the axis along which the peg rests in the hole."""

    def tip(self, tcp: Pose) -> Vector:
        """Return the end point of the peg, shape (3,), m, base frame."""
        return end_point(tcp, self.in_hand.theta, self.in_hand.length)[0]

    def axis(self, offset: Vector) -> Vector:
        """Return the axis of the peg, unit, shape (3,), whose finger centre stands off that line by `offset`, shape (2,), m."""
        return tilted_by(offset + self.in_hand.length * self.direction[:2], self.in_hand.length)

    def kept(self, tcp: Pose) -> "Aim":
        """Return the aim along which the peg lies now by its angle in the hand, so that the hand stays as it is turned."""
        return replace(self, direction=end_point(tcp, self.in_hand.theta, self.in_hand.length)[1])

    def freed(self, in_hand: InHandTip, tcp: Pose, normal: Vector) -> "Aim":
        """Return the aim after a jam: theta as the skin now reads it, and every other time the direction along which
        the peg rests.

        Where little of the plate was felt, the hole tells its own axis better than the surface estimate does.
        """
        _, resting = end_point(tcp, in_hand.theta, in_hand.length)
        return Aim(in_hand, resting, False) if self.is_by_plate else Aim(in_hand, normal, True)


@dataclass(frozen=True, slots=True, eq=False)
class TiltSweep:
    """A swing of the hand about its closing axis, from one side to the other, which takes a peg that both walls hold through the hole's axis; pure.

    A wrong theta aims the hand aside in the one plane in which the peg pivots between the pads. The walls let the peg lean by so much at its depth, and
    that is what the hand has to be turned by; which way is not known. Turned the wrong way the peg pivots in the hand, so that little force builds up.
    """

    began: float = -math.inf
    """Time at which it began, as time of running, s."""
    amplitude: float = 0.0
    """Largest offset of the finger centre, m; its sign is the side that is swept first."""
    direction: Vector = field(default_factory=lambda: np.zeros(2))
    """Direction of the offset, unit, shape (2,), base frame."""

    def is_on(self, elapsed: float, params: SpiralAdjustParams) -> bool:
        """Return whether the hand still sweeps, `elapsed` seconds after the adjustment began."""
        return elapsed - self.began < params.sweep_time

    def next(self, elapsed: float, tcp: Pose, tilt: float, length: float) -> "TiltSweep":
        """Return the sweep that begins now, first to the other side than the last one.

        Args:
            elapsed: Time of running, s.
            tcp: Pose of the hand, T_base_tcp.
            tilt: Largest lean that the hole allows the peg at its depth, rad.
            length: Length of the peg from its end to the finger centre, m.
        """
        across = tcp.rotation[:2, 1]
        amplitude = length * min(tilt + SWEPT_BEYOND, MOST_SWEPT)
        return TiltSweep(
            elapsed, -math.copysign(amplitude, self.amplitude), across / max(float(np.linalg.norm(across)), 1e-9)
        )

    def offset(self, elapsed: float, params: SpiralAdjustParams) -> Vector:
        """Return the offset of the finger centre from the line that the peg is aimed along, shape (2,), m."""
        turned = 2.0 * math.pi * (elapsed - self.began) / params.sweep_time
        return self.amplitude * math.sin(turned) * self.direction


@dataclass(frozen=True, slots=True)
class Guide:
    """Whether the hole guides the peg, and how much deeper each period of the dither brought it; pure."""

    began: float = math.inf
    """Time at which the peg was first deep enough to be guided, as time of running, s; infinite before."""
    periods: int = 0
    """Number of periods of the dither that are over."""
    reached: float = 0.0
    """Depth at the end of the last period, m."""
    is_jammed: bool = False
    """Whether a period ended in this scan in which the peg stood still or crept."""

    @property
    def is_on(self) -> bool:
        """Whether the hole guides the peg."""
        return math.isfinite(self.began)

    def after(self, depth: float, elapsed: float, params: SpiralAdjustParams) -> "Guide":
        """Return the guide after a scan at `depth`, m, `elapsed` seconds after the adjustment began."""
        if not self.is_on and depth <= params.guided_depth:
            return self
        began = min(self.began, elapsed)
        if int((elapsed - began) / params.dither_period) <= self.periods:
            return Guide(began, self.periods, self.reached)
        return Guide(began, self.periods + 1, depth, is_jammed=depth - self.reached < CREEP * params.jammed)

    def offset(self, elapsed: float, params: SpiralAdjustParams, share: float) -> Vector:
        """Return the offset of the finger centre from the line that the peg is aimed along, shape (2,), m.

        Args:
            elapsed: Time of running, s.
            params: Sizes and rates of spiral and dither.
            share: Share of the dither's radius, from 0 for a peg that slides to 1 for one that rests.
        """
        if not self.is_on:
            return spiral(elapsed % (params.radius / params.growth), params.growth, params.turn_rate)
        return dither(elapsed - self.began, share * params.dither_radius, params.dither_rate, params.dither_period)
