"""Take the peg from a rack slot: come from above, close with a set force, draw it out, and make sure that it came along."""

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.frames import UP, angle_between
from drivers.quantities import Twist, Vector
from skills.contract import Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.motion import VALIDITY, Goal, Transfer, Trim, move, stay

ACROSS_RACK: Vector = np.array([0.0, -1.0, 0.0])
"""Where the closing axis points at the rack: always the same way, or the wrist would wind up from run to run."""

CENTRED = (2e-4, math.radians(0.2))
"""The hand is closed at once where it is so close to the slot along every axis, m, and to its directions, rad."""
CENTRING_TIME = 2.0
"""Longest time for that, s."""
NEAR = (1e-3, math.radians(1.0))
"""It is not closed at all where it is further off after that: the slot leaves no more."""
TRIM = Trim(rate=6.0, limit=0.01)
"""Of the hand's place there, along each axis."""
INTEGRAL_GAIN, INTEGRAL_LIMIT = 300.0, 6.0
"""Of the arm's integral of its direction there, N·m/(rad·s), and its saturation, N·m."""
DRAWING_SPEED = 0.05
"""At which the peg leaves the slot, m/s: faster, it would be drawn through the pads where it rubs."""
DRAWING_TIME = 2.0
"""Longest time for that, over what the speed takes."""


class GraspFromRackParams(SkillParams):
    """How to take a peg."""

    transfer: Transfer
    """How the hand goes to the slot and away from it."""
    force: Annotated[float, Field(gt=0.0, le=70.0)]
    """Grip force, N."""
    opening: Annotated[float, Field(gt=0.0, le=0.08)]
    """Distance between the pads on the way down, m."""
    clearance: Annotated[float, Field(gt=0.0, le=0.3)]
    """Height of the fingers' way above the slot, m; also how far the peg is lifted."""
    closing_time: Annotated[float, Field(gt=0.0, le=10.0)]
    """Longest time for the fingers to close, s."""
    width_tolerance: Annotated[float, Field(gt=0.0, le=0.005)]
    """Largest difference between the pads' distance and the peg's width between them, m."""


@dataclass(frozen=True, slots=True)
class GraspFromRackResult(SkillResult):
    """What the hand holds."""

    width: float
    """Distance between the pads at the end, m."""
    theta: float
    """In-hand angle after the lift, rad."""


def run(params: GraspFromRackParams, ctx: SkillContext) -> GraspFromRackResult:
    """Take the peg of the job's slot."""
    started = ctx.clock.now()
    job = ctx.job
    slot = np.array(job.rack.first) + np.array([0.0, job.rack.pitch * (job.slot % job.rack.slots), 0.0])
    # The peg stands on the slot's floor, so the finger centre goes `length` above that floor.
    grip_at = slot + UP * (job.peg.length - job.rack.depth)

    ctx.gripper.release(params.opening)
    above = Goal(grip_at + UP * params.clearance, UP, ACROSS_RACK)
    for _ in move(above, params.transfer, ctx, None):
        pass
    for _ in move(Goal(grip_at, UP, ACROSS_RACK), params.transfer, ctx, None, settle=0.0):
        pass
    if not _centre(grip_at, ctx):
        return _missed(params, ctx, started, Reason.MISSED_GRASP)
    ctx.gripper.grip(params.force)
    for seen in ctx.scan(params.closing_time):
        if seen.gripper.is_gripping or not seen.gripper.is_moving:
            break
        stay(ctx, seen.stamp)
    if not _holds_peg(params, ctx):
        return _missed(params, ctx, started, Reason.MISSED_GRASP)
    _draw_out(grip_at[2] + job.rack.depth, ctx)
    for _ in move(above, params.transfer, ctx, None):
        pass
    if not _holds_peg(params, ctx):
        return _missed(params, ctx, started, Reason.LOST_GRASP)
    seen = ctx.observe()
    return GraspFromRackResult(
        Outcome.SUCCESS, Reason.NONE, ctx.clock.now() - started, seen.gripper.width, seen.peg.theta
    )


def _centre(grip_at: Vector, ctx: SkillContext) -> bool:
    """Bring the open hand to the slot, from which friction in the joints holds it off; return whether it is near enough.

    Closed aslant, it would jam the peg there. The setpoint that is left behind balances the friction.
    """
    trims = [TRIM] * 3
    assert ctx.held is not None
    held = replace(ctx.held, id=ctx.new_id(), twist=None, integral_gain=INTEGRAL_GAIN, integral_limit=INTEGRAL_LIMIT)
    off, aslant = np.full(3, math.inf), math.inf
    for seen in ctx.scan(CENTRING_TIME):
        hand = seen.arm.tcp
        off = grip_at - hand.position
        aslant = max(angle_between(-hand.rotation[:, 0], UP), angle_between(hand.rotation[:, 2], ACROSS_RACK))
        if float(np.abs(off).max()) < CENTRED[0] and aslant < CENTRED[1]:
            break
        trims = [trim.after(float(error), ctx.scan_period) for trim, error in zip(trims, off, strict=True)]
        tip = grip_at + np.array([trim.value for trim in trims])
        held = replace(held, tip=tip, valid_until=seen.stamp + VALIDITY)
        ctx.follow(held)
    ctx.follow(replace(held, integral_gain=0.0))
    return float(np.abs(off).max()) < NEAR[0] and aslant < NEAR[1]


def _draw_out(height: float, ctx: SkillContext) -> None:
    """Rise from the setpoint that is held until the finger centre is at `height`, m, base frame, where the slot ends."""
    held = ctx.held
    assert held is not None
    twist = Twist(UP * DRAWING_SPEED, np.zeros(3))
    for seen in ctx.scan(DRAWING_TIME * (height - held.tip[2]) / DRAWING_SPEED):
        if seen.arm.tcp.position[2] >= height:
            break
        tip = held.tip + twist.linear * seen.elapsed
        ctx.follow(replace(held, tip=tip, twist=twist, valid_until=seen.stamp + VALIDITY))


def _holds_peg(params: GraspFromRackParams, ctx: SkillContext) -> bool:
    hand = ctx.gripper.read()
    return hand.is_gripping and abs(hand.width - ctx.job.peg.part.thickness) <= params.width_tolerance


def _missed(params: GraspFromRackParams, ctx: SkillContext, started: float, reason: Reason) -> GraspFromRackResult:
    seen = ctx.observe()
    ctx.gripper.release(params.opening)
    return GraspFromRackResult(Outcome.FAILURE, reason, ctx.clock.now() - started, seen.gripper.width, seen.peg.theta)
