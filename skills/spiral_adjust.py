"""Keep the tip still and tilt the peg along a growing spiral, pushing, until it is seated: [gibbons], Sec. V.B."""

import math
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.frames import angle_between, end_point
from drivers.quantities import ArmState, ImpedanceSetpoint, InHandTip, Pose, Twist, Vector
from skills.contract import Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.latch_looks import Looks
from skills.motion import VALIDITY, Gains, anchored, tilted_by
from skills.paths import dither, spiral
from skills.play import allowed_tilt
from skills.seating import (
    CLOSED_TOLERANCE,
    OPEN_TOLERANCE,
    Arrival,
    depth_of,
    is_seated,
    require_short_of_bottom,
)
from skills.surface import Plane, nominal

ARRIVING = 3.0
"""Factor on the damping along z close to the bottom."""
SLIDING = 0.03
"""Speed of the tip along the hole from which on the peg is not dithered, m/s: friction of a peg that slides points against
its motion and not aside, so that nothing has to be freed, and a peg that is turned beyond its play while it goes down
strikes the wall.
"""
AT_BOTTOM = 2.0
"""Multiple of the stall timeout that a peg at the bottom is given."""
CREEP = 10.0
"""Multiple of `jammed` that a peg must gain in a period of the dither, or it is freed as one that stands still is: a peg that
is pushed along its hole gains fifty times as much, and one that wedges creeps. Source: decision 0105."""
RAISED = 0.005
"""Height of the tip above the surface, beyond half the peg's breadth, from which on nothing holds the peg and the attempt ends, m: the rim of a
leaning peg stands on the plate with its middle at most half a breadth above it, and plate and theta err by millimetres. A hand whose joints
rub more than they push is lifted by its own spiral.
"""
SWEPT_BEYOND = 0.015
"""Angle of a tilt sweep beyond the lean that the hole allows, rad: friction of the joints holds the hand off its aim by about as much. Source: decision
0105.
"""
MOST_SWEPT = 0.06
"""Largest angle of a tilt sweep, rad; a wider one turns pegs out of their holes. Source: decision 0105."""
LET_GO = 0.5
"""Share of rest below which a swept peg slides, so that the hand stays as it is turned then, fraction."""
SMOOTHING = 0.3
"""Share of a new scan in the tip's speed: theta's noise moves the tip."""
SWINGING = 0.15
"""Turning rate of the hand beyond which it swings, rad/s; the dither turns it at 0.1 rad/s."""
SWING_DAMPING = 10.0
"""Growth of the damping along z with the swing, by its value without one, s/rad. Source: decision 0088."""
MOST_SWING_DAMPING = 5.0
"""Largest factor on the damping along z for a swing: torques that come 4 ms late behind 50 Hz bear 1.2 times as much. Source: decision 0088."""
SWING_PUSH = 2.0
"""Growth of the divisor of the push with the swing, s/rad. Source: decision 0088."""
SWING_SMOOTHING = 0.5
"""Share of a new scan in the hand's turning rate."""


class SpiralAdjustParams(SkillParams):
    """How to tilt the peg about its tip along a spiral of the finger centre. The skill uses no tactile measurements.

    Source: chosen, not measured.
    """

    growth: PositiveFloat
    """Growth of the spiral's radius at the finger centre, m/s. Source: derived from [gibbons], Sec. VI, 25 mm in 20 s."""
    turn_rate: PositiveFloat
    """Turning rate of the spiral, rad/s."""
    feeds_forward: bool = True
    """Whether the arm damps only the motion that differs from the spiral's. [gibbons], Eq. (6), damps all motion, so that the hand lags behind
    the spiral. Source: decision 0094."""
    radius: PositiveFloat
    """Largest radius of the spiral, m; `stall_timeout` may end the spiral before. Source: [gibbons], Sec. VI."""
    stall_timeout: Annotated[float, Field(gt=0.0, le=120.0)]
    """Stall timeout: time in which a peg that goes no deeper by `jammed` is given up, s; such a peg is not in the hole, or
    does not go in this way. The first of several attempts of `insert_peg` has 0.4 of it (decision 0093). Close to the bottom the time is
    twice as long; a switch that is still open then disagrees with the depth. Source: chosen, not measured; reason in decision 0030.
    """
    timeout: PositiveFloat
    """Longest adjustment, s; where the radius is largest sooner, the spiral starts again."""
    gains: Gains
    """Stiffness and damping ratio along x and y and in rotation. Source: chosen within the margin that `cell check` prints."""
    push_stiffness: PositiveFloat
    """Stiffness along z, which makes the push, N/m."""
    push_damping_ratio: PositiveFloat
    """Damping along z, multiple of the critical one; the larger, the slower the peg arrives at the bottom."""
    push_offset: NonNegativeFloat
    """Depth of the tip's setpoint below the tip, m."""
    guided_depth: PositiveFloat
    """Depth of the tip from which the hole guides the peg, m; beyond it a growing spiral would only load the hole's walls.
    Source: chosen, not measured; reason in decision 0021.
    """
    dither_radius: NonNegativeFloat
    """First radius of the dither of the finger centre in the guided peg, m; it fades within each period, because torque
    that friction holds jams the peg. Source: chosen, not measured; reason in decision 0030.
    """
    dither_rate: PositiveFloat
    """Turning rate of the dither, rad/s."""
    dither_period: PositiveFloat
    """Period of the dither, s; within it the radius fades to nothing."""
    jammed: NonNegativeFloat
    """Least progress of the tip in one period of the dither, m; with less the peg stands still. Below ten times as much theta is
    read anew from the skin, and every other time the peg is aimed along where it rests, so that only the dither's torque
    is left. Source: decision 0028; a creeping peg decision 0084.
    """
    arrival: NonNegativeFloat
    """Distance from the bottom within which the peg is damped more, m; it lets the peg arrive without a blow. Source:
    decision 0028.
    """
    swing_time: NonNegativeFloat = 0.6
    """Time for which a peg is let down gently where the hand still turns from the insertion, s; later the hand turns as this skill
    asks for. 0 as in [gibbons]. Source: decision 0088.
    """
    sweep_time: Annotated[float, Field(ge=0.0, le=5.0)] = 0.5
    """Time for one tilt sweep of the hand about its closing axis, to one side and to the other, after which a peg that stands still or creeps is
    dithered again, s; 0 sweeps nothing, as in [gibbons]. Source: decision 0105.
    """
    most_deep: Annotated[float, Field(gt=0.0, le=0.05)] = CLOSED_TOLERANCE
    """Depth below the bottom of an open switch at which a peg is believed to have slipped, m; the attempt then ends. Source: decision 0070."""


@dataclass(frozen=True, slots=True)
class SpiralAdjustResult(SkillResult):
    """How far the peg was tilted when the adjustment ended."""

    radius: float
    """Last commanded radius at the finger centre, m."""
    depth: float
    """Depth of the tip below the surface by the arm, m."""


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
class Swing:
    """Turning rate of the hand, smoothed, and how gently a peg is let down while the hand swings; pure.

    The insertion turns the hand upright, and its inertia carries it on. A peg that has fallen some millimetres by then has little play left in
    the hole, whose walls stop the hand with a lever of that depth.
    """

    axis: Vector
    """Direction in which the hand points at the last scan, unit, shape (3,), base frame."""
    stamp: float
    """Time of that state of the arm, s."""
    rate: float = 0.0
    """Turning rate, rad/s, >= 0."""

    def after(self, arm: ArmState) -> "Swing":
        """Return the swing after one more state of the arm; an old one changes nothing."""
        if arm.stamp <= self.stamp:
            return self
        axis = arm.tcp.rotation[:, 0]
        rate = angle_between(axis, self.axis) / (arm.stamp - self.stamp)
        return Swing(axis, arm.stamp, self.rate + SWING_SMOOTHING * (rate - self.rate))

    @property
    def _beyond(self) -> float:
        return max(self.rate - SWINGING, 0.0)

    @property
    def damping(self) -> float:
        """Factor on the damping along z, >= 1."""
        return min(1.0 + SWING_DAMPING * self._beyond, MOST_SWING_DAMPING)

    @property
    def push(self) -> float:
        """Share of the push that is kept, from 0 to 1."""
        return 1.0 / (1.0 + SWING_PUSH * self._beyond)


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
    """Time at which the peg was first deep enough to be guided, as time of running, s; None before."""
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


def run(
    params: SpiralAdjustParams, ctx: SkillContext, plane: Plane | None = None, turns_freely: bool = False
) -> SpiralAdjustResult:
    """Tilt the peg along a growing spiral about its tip until it is seated.

    Args:
        params: Parameters of the adjustment.
        ctx: The skill's context.
        plane: Surface that the search estimated; None is the job's own.
        turns_freely: Whether the hand's yaw gives way, as it must where walls keep the peg's; a torque about the peg's axis
            would press its faces against them, by its ratio to half a side.
    """
    hole, is_felt, plane = ctx.job.hole, plane is not None, plane or nominal(ctx.job.hole)
    first, arrival, looks = ctx.observe(), Arrival(), Looks()
    aim, stall, guide, descent = Aim(ctx.in_hand(), plane.normal), Stall(), Guide(), Descent(plane.depth(first.tip))
    swing = at_rest = Swing(first.arm.tcp.rotation[:, 0], first.arm.stamp)
    sweep, across = TiltSweep(), (2.0 * ctx.job.peg.part.half[1], 2.0 * hole.part.half[1])
    identity, offset, tip, running = ctx.new_id(), np.zeros(2), first.tip, 0.0
    for seen in ctx.scan(params.timeout, holding=True):
        elapsed, running, tip, is_done = seen.elapsed, seen.running, aim.tip(seen.arm.tcp), False
        if hole.latch is not None and hole.evidence == "force":
            looks = looks.after(seen, ctx.held, hole.latch, plane.depth(seen.tip) - hole.depth)
            is_done = looks.is_shown
        elif is_seated(seen.switch, tip, hole):
            arrival = arrival.after(seen, ctx.held, hole.depth - plane.depth(seen.tip) if is_felt else 0.0)
            is_done = arrival.is_over(seen.stamp)
        if is_done:
            return _result(Outcome.SUCCESS, Reason.NONE, running, offset, depth_of(tip, hole))
        if depth_of(tip, hole) > hole.depth + params.most_deep:
            ctx.note_slip()  # no tip is below the bottom of an open switch: the fingers have slid down the peg
            break
        depth = plane.depth(tip)
        stall = Stall(depth, elapsed) if looks.is_lifting else stall.after(depth, elapsed, params.jammed)
        is_raised = depth < -(ctx.job.peg.part.inscribed / 2.0 + RAISED)
        if (
            looks.is_over
            or is_raised
            or elapsed - stall.since > given_up_after(depth_of(tip, hole), hole.depth, params)
        ):
            break
        is_swept = sweep.is_on(elapsed, params)
        if is_swept and descent.rest < LET_GO:
            aim, sweep, is_swept = aim.kept(seen.arm.tcp), replace(sweep, began=-math.inf), False
        # The periods of the dither begin again after a sweep.
        guide = Guide(elapsed, reached=depth) if is_swept else guide.after(depth, elapsed, params)
        if guide.is_jammed and not looks.is_lifting:
            aim = aim.freed(ctx.in_hand(), seen.arm.tcp, plane.normal)
            tip = aim.tip(seen.arm.tcp)
            guide, descent = replace(guide, reached=plane.depth(tip)), Descent(plane.depth(tip))
            stall = stall.measured_anew(guide.reached, depth)
            sweep = sweep.next(elapsed, seen.arm.tcp, allowed_tilt(guide.reached, *across), aim.in_hand.length)
        descent = descent.after(plane.depth(tip), ctx.scan_period)
        offset, next_offset = (
            sweep.offset(elapsed + ahead, params)
            if sweep.is_on(elapsed, params)
            else guide.offset(elapsed + ahead, params, descent.rest)
            for ahead in (0.0, ctx.scan_period)
        )
        ctx.progress(elapsed / params.timeout)
        swing = swing.after(seen.arm) if running < params.swing_time else at_rest
        stiffness, damping_ratio = _compliance(params, swing, depth_of(tip, hole) > hole.depth - params.arrival)
        target = anchored(tip, first.tip) if guide.is_on else first.tip.copy()
        looks = looks.pulling(swing.push * params.push_offset, ctx.scan_period)
        target[2] = tip[2] + looks.pull
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=target,
                axis=aim.axis(offset),
                twist=_spin(aim.axis(offset), aim.axis(next_offset), ctx.scan_period) if params.feeds_forward else None,
                roll=(seen if turns_freely else first).arm.tcp.rotation[:, 2],
                stiffness=stiffness,
                damping_ratio=damping_ratio,
                valid_until=seen.stamp + VALIDITY,
                in_hand=aim.in_hand,
            )
        )
    if hole.evidence == "switch":
        require_short_of_bottom(tip, hole)
    return _result(Outcome.FAILURE, Reason.NOT_SEATED, running, offset, depth_of(tip, hole))


def _spin(axis: Vector, after: Vector, period: float) -> Twist:
    """Return the twist that takes an axis to where it is one `period` later, s."""
    return Twist(np.zeros(3), np.cross(axis, after) / period)


def given_up_after(depth: float, bottom: float, params: SpiralAdjustParams) -> float:
    """Return the time without progress after which a peg at `depth`, m, is given up, s.

    At the bottom the hand shakes it for longer, since the last millimetre is short of `jammed`; a switch that still says
    open then disagrees with the depth.
    """
    return params.stall_timeout * (AT_BOTTOM if depth >= bottom - OPEN_TOLERANCE else 1.0)


def _compliance(params: SpiralAdjustParams, swing: Swing, is_arriving: bool) -> tuple[Vector, Vector]:
    """Return stiffness and damping ratios, each shape (6,); while the hand swings, and close to the bottom, the peg is damped more."""
    stiffness, damping_ratio = params.gains.stiffness(), params.gains.damping_ratios()
    stiffness[2] = params.push_stiffness
    damping_ratio[2] = params.push_damping_ratio * max(ARRIVING if is_arriving else 1.0, swing.damping)
    return stiffness, damping_ratio


def _result(outcome: Outcome, reason: Reason, elapsed: float, offset: Vector, depth: float) -> SpiralAdjustResult:
    return SpiralAdjustResult(outcome, reason, elapsed, float(np.linalg.norm(offset)), depth)
