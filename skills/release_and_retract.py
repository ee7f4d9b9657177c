"""Let go of a seated peg and leave it in place: open, draw back, make sure that it stayed."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from drivers.frames import UP
from drivers.quantities import SwitchState
from skills.contract import Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.motion import Goal, Transfer, move, stay


class ReleaseAndRetractParams(SkillParams):
    """How to let go."""

    transfer: Transfer
    """How the hand draws back."""
    opening: Annotated[float, Field(gt=0.0, le=0.08)]
    """Distance between the pads that lets the peg go, m."""
    opening_time: Annotated[float, Field(gt=0.0, le=10.0)]
    """Longest time for the fingers to open, s."""
    height: Annotated[float, Field(gt=0.0, le=0.3)]
    """Distance to draw back, m."""


@dataclass(frozen=True, slots=True)
class ReleaseAndRetractResult(SkillResult):
    """What was left behind."""

    stayed: bool
    """The switch is still closed."""


def run(params: ReleaseAndRetractParams, ctx: SkillContext) -> ReleaseAndRetractResult:
    """Open the hand and draw it back along the fingers, then upwards."""
    first = ctx.observe()
    ctx.gripper.release(params.opening)
    for seen in ctx.scan(params.opening_time):
        if not seen.gripper.is_moving:
            break
        stay(ctx, seen.stamp)
    start = ctx.observe().arm.tcp
    back = Goal(start.position + UP * params.height, -start.rotation[:, 0], start.rotation[:, 2])
    for _ in move(back, params.transfer, ctx, None):
        pass
    seen = ctx.observe()
    elapsed = seen.stamp - first.stamp
    stayed = seen.switch is SwitchState.CLOSED
    if seen.gripper.is_gripping or seen.gripper.is_moving:
        return ReleaseAndRetractResult(Outcome.FAILURE, Reason.STILL_HELD, elapsed, stayed)
    if first.switch is SwitchState.CLOSED and not stayed:
        return ReleaseAndRetractResult(Outcome.FAILURE, Reason.NOT_SEATED, elapsed, stayed)
    return ReleaseAndRetractResult(Outcome.SUCCESS, Reason.NONE, elapsed, stayed)
