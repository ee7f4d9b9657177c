"""Let go of a seated peg and leave it in place: open, draw back, make sure that it stayed."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from drivers.frames import UP
from drivers.quantities import SwitchState
from skills.contract import Observation, Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.motion import Goal, Transfer, move, stay

ANSWER_TIME = 1.0
"""Longest wait for a switch that does not answer, s; the supervisor waits half as long. Source: chosen, not measured."""


class ReleaseAndRetractParams(SkillParams):
    """How to let go.

    Source: chosen, not measured.
    """

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
    """Open the hand and draw it back along the fingers, then upwards; a hand that does not open stays where it is."""
    first = ctx.observe()
    if not let_go(params.opening, params.opening_time, ctx):
        return _result(Outcome.FAILURE, Reason.STILL_HELD, ctx, first)
    start = ctx.observe().arm.tcp
    back = Goal(start.position + UP * params.height, -start.rotation[:, 0], start.rotation[:, 2])
    for _ in move(back, params.transfer, ctx, None):
        pass
    if ctx.job.hole.evidence == "switch" and _answer(ctx) is not SwitchState.CLOSED:
        return _result(Outcome.FAILURE, Reason.NOT_SEATED, ctx, first)
    return _result(Outcome.SUCCESS, Reason.NONE, ctx, first)


def _answer(ctx: SkillContext) -> SwitchState:
    """Return what the switch says once it answers, or that it does not. The supervisor ends a run whose success needs a switch that is silent."""
    switch = ctx.observe().switch
    if switch is not SwitchState.UNKNOWN:
        return switch
    for seen in ctx.scan(ANSWER_TIME):
        if seen.switch is not SwitchState.UNKNOWN:
            return seen.switch
        stay(ctx, seen.stamp)
    return switch


def let_go(opening: float, longest: float, ctx: SkillContext) -> bool:
    """Open the hand where it is; return whether it is wider than the peg, as a hand that does not grip may still be around it.

    Args:
        opening: Distance between the pads that lets the peg go, m.
        longest: Longest time for the fingers to open, s.
        ctx: The skill's context.
    """
    ctx.gripper.release(opening)
    for seen in ctx.scan(longest, limited=False):
        if not seen.gripper.is_moving:
            break
        stay(ctx, seen.stamp)
    return ctx.observe().gripper.is_open(ctx.job.peg.part.thickness)


def _result(outcome: Outcome, reason: Reason, ctx: SkillContext, first: Observation) -> ReleaseAndRetractResult:
    last = ctx.observe()
    return ReleaseAndRetractResult(outcome, reason, last.stamp - first.stamp, last.switch is SwitchState.CLOSED)
