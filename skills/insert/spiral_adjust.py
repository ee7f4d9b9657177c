"""Push and dither the peg down the hole, and sweep it if it jams, until it is seated."""

import math
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from drivers.frames import angle_between, cross
from drivers.parts import Job
from drivers.quantities import ArmState, ImpedanceSetpoint, Twist, Vector
from skills.contract import Observation, Outcome, Reason, SkillContext, SkillResult
from skills.insert.guided_peg import Aim, Descent, Guide, Stall, TiltSweep
from skills.insert.play import allowed_tilt
from skills.insert.spiral_params import SpiralAdjustParams
from skills.motion import VALIDITY, anchored
from skills.search.surface import Plane, nominal
from skills.seating.decision import (
    CLOSED_TOLERANCE,
    OPEN_TOLERANCE,
    Arrival,
    is_seated,
    require_short_of_bottom,
)
from skills.seating.latch_looks import Looks
from skills.seating.signature import StrokeCurve

ARRIVING = 3.0
"""Factor on the damping along z close to the bottom."""


@dataclass(frozen=True, slots=True)
class SpiralAdjustResult(SkillResult):
    """Tilt and depth of the peg at the end of the adjustment."""

    radius: float
    """Last commanded radius at the finger centre, m."""
    depth: float
    """Depth of the tip below the surface, measured by the arm, m."""


@dataclass(frozen=True, slots=True, eq=False)
class Swing:
    """Smoothed turning rate of the hand, and the damping and push of the peg while the hand swings; pure.

    The insertion turns the hand upright, and the hand's inertia turns it further. If the peg is already some millimetres deep, it has little play
    in the hole: its walls stop the hand with a lever of this depth.
    """

    axis: Vector
    """Direction in which the hand points at the last scan, unit, shape (3,), base frame."""
    stamp: float
    """Time of the arm's state at this scan, s."""
    rate: float = 0.0
    """Turning rate, rad/s, >= 0."""

    def after(self, arm: ArmState, params: SpiralAdjustParams) -> "Swing":
        """Return the swing after one more state of the arm; a repeated state changes nothing."""
        if arm.stamp <= self.stamp:
            return self
        axis = arm.tcp.rotation[:, 0]
        rate = angle_between(axis, self.axis) / (arm.stamp - self.stamp)
        return Swing(axis, arm.stamp, self.rate + params.swing_smoothing * (rate - self.rate))

    def damping(self, params: SpiralAdjustParams) -> float:
        """Return the factor on the damping along z, >= 1."""
        return min(1.0 + params.swing_damping * max(self.rate - params.swinging, 0.0), params.most_swing_damping)

    def push(self, params: SpiralAdjustParams) -> float:
        """Return the remaining share of the push, from 0 to 1."""
        return 1.0 / (1.0 + params.swing_push * max(self.rate - params.swinging, 0.0))


@dataclass(slots=True)
class SeatingEvidence:
    """Evidence of a seated peg: the switch with the depth, or the force of a latch."""

    is_felt: bool
    """True if the search has estimated the surface."""
    looks: Looks
    arrival: Arrival = field(default_factory=Arrival)

    def is_given(self, seen: Observation, tip: Vector, plane: Plane, ctx: SkillContext) -> bool:
        """Process one scan; return True if the peg is seated."""
        hole = ctx.job.hole
        if hole.latch is not None and hole.evidence == "force":
            beyond = plane.depth(seen.tip) - hole.depth
            self.looks = self.looks.after(seen, ctx.lead.held, hole.latch, beyond)
            ctx.peg = replace(ctx.peg, ways=self.looks.curve.ways)
            return self.looks.is_shown
        if not is_seated(seen.switch, plane.depth(tip), hole):
            return False
        short = hole.depth - plane.depth(seen.tip) if self.is_felt else 0.0
        self.arrival = self.arrival.after(seen, ctx.lead.held, short)
        return self.arrival.is_over(seen.stamp)


class Guidance:
    """Peg on its way down the hole: its aim, its progress, and the motions that free it if it jams."""

    def __init__(self, params: SpiralAdjustParams, ctx: SkillContext, plane: Plane, descent: Descent) -> None:
        """Start along the plate's normal."""
        self._params, self._ctx, self._plane, self._descent = params, ctx, plane, descent
        self._stall, self._guide, self._sweep = Stall(), Guide(), TiltSweep()
        self.aim = Aim(ctx.in_hand(), plane.normal)
        """Assumed pose of the peg and direction of the push."""

    def is_stalled(self, tip: Vector, elapsed: float, is_lifting: bool) -> bool:
        """Process the position of the tip, m; return True if the peg has made no progress for too long."""
        depth = self._plane.depth(tip)
        self._stall = Stall(depth, elapsed) if is_lifting else self._stall.after(depth, elapsed, self._params.jammed)
        return elapsed - self._stall.since > given_up_after(depth, self._ctx.job.hole.depth, self._params)

    def free(self, seen: Observation, tip: Vector, is_lifting: bool) -> Vector:
        """Process one scan, and start to free the peg if it jams; return its end point by the aim, shape (3,), m, base frame."""
        elapsed, tcp, params = seen.elapsed, seen.arm.tcp, self._params
        depth = self._plane.depth(tip)
        if self._sweep.is_on(elapsed, params) and self._descent.rest(params) < params.let_go:
            self.aim, self._sweep = self.aim.kept(tcp), replace(self._sweep, began=-math.inf)
        # The periods of the dither begin again after a sweep.
        is_swept = self._sweep.is_on(elapsed, params)
        self._guide = Guide(elapsed, reached=depth) if is_swept else self._guide.after(depth, elapsed, params)
        if self._guide.is_jammed and not is_lifting:
            tip = self._aim_anew(seen, depth)
            depth = self._plane.depth(tip)
        self._descent = self._descent.after(depth, self._ctx.schedule.period, params)
        return tip

    def _aim_anew(self, seen: Observation, before: float) -> Vector:
        """Aim with the newest theta, sweep, and return the end point; `before` is the depth by the previous theta, m."""
        self.aim = self.aim.freed(self._ctx.in_hand(), seen.arm.tcp, self._plane.normal)
        tip = self.aim.tip(seen.arm.tcp)
        depth = self._plane.depth(tip)
        self._guide, self._descent = replace(self._guide, reached=depth), Descent(depth)
        self._stall = self._stall.measured_anew(depth, before)
        peg, hole = (2.0 * part.half[1] for part in (self._ctx.job.peg.part, self._ctx.job.hole.part))
        tilt = allowed_tilt(depth, peg, hole)
        self._sweep = self._sweep.next(seen.elapsed, seen.arm.tcp, tilt, self.aim.in_hand.length, self._params)
        return tip

    def offsets(self, elapsed: float) -> list[Vector]:
        """Return the offsets of the finger centre from the line of the aim, now and one scan later, shape (2,), m."""
        is_swept = self._sweep.is_on(elapsed, self._params)
        moves = self._sweep.offset if is_swept else partial(self._guide.offset, share=self._descent.rest(self._params))
        return [moves(elapsed + ahead, self._params) for ahead in (0.0, self._ctx.schedule.period)]


def run(
    params: SpiralAdjustParams, ctx: SkillContext, plane: Plane | None = None, turns_freely: bool = False
) -> SpiralAdjustResult:
    """Push the peg down the hole and tilt it about its tip, on small circles or on a sweep, until it is seated.

    Args:
        params: Parameters of the adjustment.
        ctx: The skill's context.
        plane: Surface estimate of the search; None for the surface stated in the job.
        turns_freely: True if the setpoint follows the hand's yaw. This is necessary if walls hold the peg's yaw: a torque about
            the peg's axis would press its faces against them.
    """
    is_felt, plane = plane is not None, plane or nominal(ctx.job.hole)
    hole, first, proof = ctx.job.hole, ctx.observe(), SeatingEvidence(is_felt, Looks(StrokeCurve(earlier=ctx.peg.ways)))
    down = Guidance(params, ctx, plane, Descent(plane.depth(first.tip)))
    swing = at_rest = Swing(first.arm.tcp.rotation[:, 0], first.arm.stamp)
    identity, offset, tip, running = ctx.new_id(), np.zeros(2), first.tip, 0.0
    for seen in ctx.scan(params.timeout, holding=True):
        elapsed, running, tip = seen.elapsed, seen.running, down.aim.tip(seen.arm.tcp)
        if proof.is_given(seen, tip, plane, ctx):
            return _result(Outcome.SUCCESS, Reason.NONE, running, offset, plane.depth(tip))
        if angle_between(seen.axis, plane.normal) > params.leaning:
            return _result(Outcome.FAILURE, Reason.NOT_ALIGNED, running, offset, plane.depth(tip))
        is_stalled = down.is_stalled(tip, elapsed, proof.looks.is_lifting)
        if _has_left(tip, plane, ctx.job, params) or is_stalled or proof.looks.is_over:
            break
        tip = down.free(seen, tip, proof.looks.is_lifting)
        offset, next_offset = down.offsets(elapsed)
        ctx.callbacks.progress(elapsed / params.timeout)
        swing = swing.after(seen.arm, params) if running < params.swing_time else at_rest
        stiffness, damping_ratio = _compliance(params, swing, plane.depth(tip) > hole.depth - params.arrival)
        proof.looks = proof.looks.pulling(swing.push(params) * params.push_offset, ctx.schedule.period)
        # The setpoint follows the tip within the distance `STRAY` of the found hole; its height is the tip's plus the pull.
        beside, axis = anchored(tip, first.tip), down.aim.axis(offset)
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=np.array([beside[0], beside[1], tip[2] + proof.looks.pull]),
                axis=axis,
                twist=Twist(np.zeros(3), cross(axis, down.aim.axis(next_offset)) / ctx.schedule.period),
                roll=(seen if turns_freely else first).arm.tcp.rotation[:, 2],
                stiffness=stiffness,
                damping_ratio=damping_ratio,
                valid_until=seen.stamp + VALIDITY,
                in_hand=down.aim.in_hand,
            )
        )
    if hole.evidence == "switch":
        require_short_of_bottom(plane.depth(tip), hole)
    return _result(Outcome.FAILURE, Reason.NOT_SEATED, running, offset, plane.depth(tip))


def _has_left(tip: Vector, plane: Plane, job: Job, params: SpiralAdjustParams) -> bool:
    """Return True if nothing holds the peg above the surface, or if its end seems to be below the bottom.

    If it is below the bottom, the fingers have slid down the peg, which the next touch-down measures, or this is another hole.
    """
    is_above = plane.depth(tip) < -(job.peg.part.inscribed / 2.0 + params.raised)
    is_below = plane.depth(tip) > job.hole.depth + CLOSED_TOLERANCE
    return is_above or is_below


def given_up_after(depth: float, bottom: float, params: SpiralAdjustParams) -> float:
    """Return the time without progress after which the adjustment of a peg at `depth`, m, ends, s.

    Near the bottom it is longer, because the depth gain of the last millimetre can stay below `jammed`. If the switch is
    still open after this time, it disagrees with the depth.
    """
    return params.stall_at_bottom if depth >= bottom - OPEN_TOLERANCE else params.stall_timeout


def _compliance(params: SpiralAdjustParams, swing: Swing, is_arriving: bool) -> tuple[Vector, Vector]:
    """Return stiffness and damping ratios, each shape (6,); while the hand swings, and close to the bottom, the peg is damped more."""
    stiffness, damping_ratio = params.gains.stiffness(), params.gains.damping_ratios()
    stiffness[2] = params.push_stiffness
    damping_ratio[2] = params.push_damping_ratio * max(ARRIVING if is_arriving else 1.0, swing.damping(params))
    return stiffness, damping_ratio


def _result(outcome: Outcome, reason: Reason, elapsed: float, offset: Vector, depth: float) -> SpiralAdjustResult:
    return SpiralAdjustResult(outcome, reason, elapsed, float(np.linalg.norm(offset)), depth)
