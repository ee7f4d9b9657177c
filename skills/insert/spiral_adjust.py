"""Dither the peg down the hole, pushing, and sweep it if it jams, until it is seated."""

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from drivers.frames import angle_between, cross
from drivers.quantities import ArmState, ImpedanceSetpoint, Twist, Vector
from skills.contract import Outcome, Reason, SkillContext, SkillResult
from skills.insert.guided_peg import LET_GO, Aim, Descent, Guide, Stall, TiltSweep
from skills.insert.play import allowed_tilt
from skills.insert.spiral_params import SpiralAdjustParams
from skills.motion import VALIDITY, anchored
from skills.search.surface import Plane, nominal
from skills.seating.decision import (
    CLOSED_TOLERANCE,
    OPEN_TOLERANCE,
    Arrival,
    depth_of,
    is_seated,
    require_short_of_bottom,
)
from skills.seating.latch_looks import Looks
from skills.seating.signature import StrokeCurve

ARRIVING = 3.0
"""Factor on the damping along z close to the bottom."""
RAISED = 0.005
"""Height of the tip above the surface, beyond half the peg's breadth, from which on nothing holds the peg and the attempt ends, m: the rim of a
leaning peg stands on the plate with its middle at most half a breadth above it, and plate and theta err by millimetres. A hand whose joints
rub more than they push is lifted by its own spiral. Source: chosen, not measured.
"""
SWINGING = 0.15
"""Turning rate of the hand beyond which it swings, rad/s; the dither turns it at 0.1 rad/s. Source: chosen, not measured."""
SWING_DAMPING = 10.0
"""Growth of the damping along z with the swing, by its value without one, s/rad. Source: docs/tried/adjustment.md."""
MOST_SWING_DAMPING = 5.0
"""Largest factor on the damping along z for a swing: torques that come 4 ms late behind 50 Hz bear 1.2 times as much. Source: docs/tried/adjustment.md."""
SWING_PUSH = 2.0
"""Growth of the divisor of the push with the swing, s/rad. Source: docs/tried/adjustment.md."""
SWING_SMOOTHING = 0.5
"""Share of a new scan in the hand's turning rate."""


@dataclass(frozen=True, slots=True)
class SpiralAdjustResult(SkillResult):
    """How far the peg was tilted when the adjustment ended."""

    radius: float
    """Last commanded radius at the finger centre, m."""
    depth: float
    """Depth of the tip below the surface by the arm, m."""


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


def run(
    params: SpiralAdjustParams, ctx: SkillContext, plane: Plane | None = None, turns_freely: bool = False
) -> SpiralAdjustResult:
    """Push the peg down the hole and tilt it about its tip, on small circles or on a sweep, until it is seated.

    Args:
        params: Parameters of the adjustment.
        ctx: The skill's context.
        plane: Surface that the search estimated; None is the job's own.
        turns_freely: Whether the hand's yaw gives way, as it must where walls keep the peg's; a torque about the peg's axis
            would press its faces against them, by its ratio to half a side.
    """
    hole, is_felt, plane = ctx.job.hole, plane is not None, plane or nominal(ctx.job.hole)
    first, arrival, looks = ctx.observe(), Arrival(), Looks(StrokeCurve(earlier=ctx.peg.ways))
    aim, stall, guide, descent = Aim(ctx.in_hand(), plane.normal), Stall(), Guide(), Descent(plane.depth(first.tip))
    swing = at_rest = Swing(first.arm.tcp.rotation[:, 0], first.arm.stamp)
    sweep, across = TiltSweep(), (2.0 * ctx.job.peg.part.half[1], 2.0 * hole.part.half[1])
    identity, offset, tip, running = ctx.new_id(), np.zeros(2), first.tip, 0.0
    for seen in ctx.scan(params.timeout, holding=True):
        elapsed, running, tip, is_done = seen.elapsed, seen.running, aim.tip(seen.arm.tcp), False
        if hole.latch is not None and hole.evidence == "force":
            looks = looks.after(seen, ctx.lead.held, hole.latch, plane.depth(seen.tip) - hole.depth)
            is_done, ctx.peg = looks.is_shown, replace(ctx.peg, ways=looks.curve.ways)
        elif is_seated(seen.switch, tip, hole):
            arrival = arrival.after(seen, ctx.lead.held, hole.depth - plane.depth(seen.tip) if is_felt else 0.0)
            is_done = arrival.is_over(seen.stamp)
        if is_done:
            return _result(Outcome.SUCCESS, Reason.NONE, running, offset, depth_of(tip, hole))
        if depth_of(tip, hole) > hole.depth + CLOSED_TOLERANCE:
            break  # the fingers have slid down the peg, which the next touch-down measures, or the hole is another one
        depth = plane.depth(tip)
        stall = Stall(depth, elapsed) if looks.is_lifting else stall.after(depth, elapsed, params.jammed)
        is_stalled = elapsed - stall.since > given_up_after(depth_of(tip, hole), hole.depth, params)
        if looks.is_over or is_stalled or depth < -(ctx.job.peg.part.inscribed / 2.0 + RAISED):
            break
        if sweep.is_on(elapsed, params) and descent.rest < LET_GO:
            aim, sweep = aim.kept(seen.arm.tcp), replace(sweep, began=-math.inf)
        # The periods of the dither begin again after a sweep.
        guide = Guide(elapsed, reached=depth) if sweep.is_on(elapsed, params) else guide.after(depth, elapsed, params)
        if guide.is_jammed and not looks.is_lifting:
            aim = aim.freed(ctx.in_hand(), seen.arm.tcp, plane.normal)
            tip = aim.tip(seen.arm.tcp)
            guide, descent = replace(guide, reached=plane.depth(tip)), Descent(plane.depth(tip))
            stall = stall.measured_anew(guide.reached, depth)
            sweep = sweep.next(elapsed, seen.arm.tcp, allowed_tilt(guide.reached, *across), aim.in_hand.length)
        descent = descent.after(plane.depth(tip), ctx.schedule.period)
        moves = sweep.offset if sweep.is_on(elapsed, params) else partial(guide.offset, share=descent.rest)
        offset, next_offset = (moves(elapsed + ahead, params) for ahead in (0.0, ctx.schedule.period))
        ctx.callbacks.progress(elapsed / params.timeout)
        swing = swing.after(seen.arm) if running < params.swing_time else at_rest
        stiffness, damping_ratio = _compliance(params, swing, depth_of(tip, hole) > hole.depth - params.arrival)
        looks = looks.pulling(swing.push * params.push_offset, ctx.schedule.period)
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=_target(tip, first.tip, looks.pull),
                axis=aim.axis(offset),
                twist=_spin(aim.axis(offset), aim.axis(next_offset), ctx.schedule.period),
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


def _target(tip: Vector, found: Vector, pull: float) -> Vector:
    """Return the setpoint of the tip, shape (3,), m: off the tip's height by a pull, m, and no further than a hole can be from where it was `found`."""
    beside = anchored(tip, found)
    return np.array([beside[0], beside[1], tip[2] + pull])


def _spin(axis: Vector, after: Vector, period: float) -> Twist:
    """Return the twist that takes an axis to where it is one `period` later, s."""
    return Twist(np.zeros(3), cross(axis, after) / period)


def given_up_after(depth: float, bottom: float, params: SpiralAdjustParams) -> float:
    """Return the time without progress after which a peg at `depth`, m, is given up, s.

    At the bottom the hand shakes it for longer, since the last millimetre is short of `jammed`; a switch that still says
    open then disagrees with the depth.
    """
    return params.stall_at_bottom if depth >= bottom - OPEN_TOLERANCE else params.stall_timeout


def _compliance(params: SpiralAdjustParams, swing: Swing, is_arriving: bool) -> tuple[Vector, Vector]:
    """Return stiffness and damping ratios, each shape (6,); while the hand swings, and close to the bottom, the peg is damped more."""
    stiffness, damping_ratio = params.gains.stiffness(), params.gains.damping_ratios()
    stiffness[2] = params.push_stiffness
    damping_ratio[2] = params.push_damping_ratio * max(ARRIVING if is_arriving else 1.0, swing.damping)
    return stiffness, damping_ratio


def _result(outcome: Outcome, reason: Reason, elapsed: float, offset: Vector, depth: float) -> SpiralAdjustResult:
    return SpiralAdjustResult(outcome, reason, elapsed, float(np.linalg.norm(offset)), depth)
