"""Free hand and arm after a failure: draw up, drop what is held into the reject bin, come back above the rack."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.frames import UP
from drivers.parts import Point
from skills.contract import Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.grasp_from_rack import ACROSS_RACK
from skills.motion import Goal, Transfer, move, stay

MARGIN = 0.01
"""From the edge of the workspace, m."""


class RecoverParams(SkillParams):
    """How to come back."""

    transfer: Transfer
    """How the hand goes to the bin."""
    height: Annotated[float, Field(gt=0.0, le=0.3)]
    """Distance to draw up first, m."""
    bin: Point
    """Place above the reject bin where the peg is let go, m, base frame."""
    opening: Annotated[float, Field(gt=0.0, le=0.08)]
    """Distance between the pads that lets the peg go, m."""
    opening_time: Annotated[float, Field(gt=0.0, le=10.0)]
    """Longest time for the fingers to open, s."""


@dataclass(frozen=True, slots=True)
class RecoverResult(SkillResult):
    """Whether a peg was dropped."""

    dropped: bool


def run(params: RecoverParams, ctx: SkillContext) -> RecoverResult:
    """Draw up, turn the hand down above the bin, open it."""
    first = ctx.observe()
    held = first.gripper.is_gripping
    tcp = first.arm.tcp
    low, high = np.array(ctx.limits.low), np.array(ctx.limits.high)
    inside = np.clip(tcp.position + UP * params.height, low + MARGIN, high - MARGIN)
    out = Goal(inside, -tcp.rotation[:, 0], tcp.rotation[:, 2])
    # What the failure left pressed or outside must first be free to move away.
    for _ in move(out, params.transfer, ctx, None, limited=False):
        pass
    for _ in move(Goal(np.array(params.bin), UP, ACROSS_RACK), params.transfer, ctx, None):
        pass
    ctx.gripper.release(params.opening)
    for seen in ctx.scan(params.opening_time):
        if not seen.gripper.is_moving:
            break
        stay(ctx, seen.stamp)
    last = ctx.observe()
    elapsed = last.stamp - first.stamp
    if last.gripper.is_gripping or last.gripper.is_moving:
        return RecoverResult(Outcome.FAILURE, Reason.STILL_HELD, elapsed, False)
    return RecoverResult(Outcome.SUCCESS, Reason.NONE, elapsed, held)
