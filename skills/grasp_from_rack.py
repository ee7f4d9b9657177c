"""Take the peg from a rack slot: come from above, close with a set force, lift, and make sure that it came along."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.frames import UP
from drivers.quantities import Vector
from skills.contract import Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.motion import Goal, Transfer, move, stay

ACROSS_RACK: Vector = np.array([0.0, -1.0, 0.0])
"""Where the closing axis points at the rack: always the same way, or the wrist would wind up from run to run."""


class GraspFromRackParams(SkillParams):
    """How to take a peg."""

    transfer: Transfer
    """To the slot and away from it."""
    force: Annotated[float, Field(gt=0.0, le=70.0)]
    """Grip force, N."""
    opening: Annotated[float, Field(gt=0.0, le=0.08)]
    """Distance between the pads on the way down, m."""
    clearance: Annotated[float, Field(gt=0.0, le=0.3)]
    """Height of the fingers' way above the slot, m; also how far the peg is lifted."""
    closing_time: Annotated[float, Field(gt=0.0, le=10.0)]
    """Longest time for the fingers to close, s."""
    width_tolerance: Annotated[float, Field(gt=0.0, le=0.005)]
    """The pads must stand within this of the peg's diameter, m."""


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
    roll = ACROSS_RACK
    slot = np.array(job.rack.first) + np.array([0.0, job.rack.pitch * (job.slot % job.rack.slots), 0.0])
    # The peg stands on the slot's floor, so the finger centre goes `length` above that floor.
    grip_at = slot + UP * (job.peg.length - job.rack.depth)

    ctx.gripper.release(params.opening)
    for tip in (grip_at + UP * params.clearance, grip_at):
        for _ in move(Goal(tip, UP, roll), params.transfer, ctx, None):
            pass
    ctx.gripper.grip(params.force)
    for seen in ctx.scan(params.closing_time):
        if seen.gripper.is_gripping or not seen.gripper.is_moving:
            break
        stay(ctx, seen.stamp)
    if not _holds_peg(params, ctx):
        return _missed(params, ctx, started, Reason.MISSED_GRASP)
    for _ in move(Goal(grip_at + UP * params.clearance, UP, roll), params.transfer, ctx, None):
        pass
    if not _holds_peg(params, ctx):
        return _missed(params, ctx, started, Reason.LOST_GRASP)
    seen = ctx.observe()
    return GraspFromRackResult(
        Outcome.SUCCESS, Reason.NONE, ctx.clock.now() - started, seen.gripper.width, seen.peg.theta
    )


def _holds_peg(params: GraspFromRackParams, ctx: SkillContext) -> bool:
    hand = ctx.gripper.read()
    return hand.is_gripping and abs(hand.width - ctx.job.peg.diameter) <= params.width_tolerance


def _missed(params: GraspFromRackParams, ctx: SkillContext, started: float, reason: Reason) -> GraspFromRackResult:
    seen = ctx.observe()
    ctx.gripper.release(params.opening)
    return GraspFromRackResult(Outcome.FAILURE, reason, ctx.clock.now() - started, seen.gripper.width, seen.peg.theta)
