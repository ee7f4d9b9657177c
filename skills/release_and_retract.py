"""Release a seated peg: open the hand, retract, check that the peg stayed."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from pydantic import Field

from drivers.config_model import Figure, Quantity
from drivers.frames import UP
from drivers.quantities import SwitchState
from skills.contract import Observation, Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.motion import Goal, Transfer, move, stay

HAND_TIME = 3.0
"""Longest time for the fingers to open or close, s; the Franka hand's whole stroke of 80 mm takes 1.6 s at 0.05 m/s. Source: chosen, not measured."""


class ReleaseAndRetractParams(SkillParams):
    """Parameters of releasing the peg."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    transfer: Annotated[Transfer, Figure(""), Field(exclude=True)] = Transfer()
    """Motion of the hand while it retracts."""
    opening: Annotated[float, Field(gt=0.0, le=0.08), Quantity("m")]
    """Distance between the pads that releases the peg, m."""
    height: Annotated[float, Field(gt=0.0, le=0.3), Quantity("m")]
    """Distance to retract, m."""
    answer_time: Annotated[float, Figure("s"), Field(exclude=True)] = 1.0
    """Timeout of the switch, s; the supervisor waits half as long."""


@dataclass(frozen=True, slots=True)
class ReleaseAndRetractResult(SkillResult):
    """State of the peg after its release."""

    stayed: bool
    """True if the switch is still closed."""


def run(params: ReleaseAndRetractParams, ctx: SkillContext) -> ReleaseAndRetractResult:
    """Open the hand and retract it upwards; if the hand does not open, it stays in place."""
    first = ctx.observe()
    if not let_go(params.opening, ctx):
        return _result(Outcome.FAILURE, Reason.STILL_HELD, ctx, first)
    start = ctx.observe().arm.tcp
    back = Goal(start.position + UP * params.height, -start.rotation[:, 0], start.rotation[:, 2])
    for _ in move(back, params.transfer, ctx, None, settle=0.0):
        pass
    if ctx.job.hole.evidence == "switch" and _answer(params, ctx) is not SwitchState.CLOSED:
        return _result(Outcome.FAILURE, Reason.NOT_SEATED, ctx, first)
    return _result(Outcome.SUCCESS, Reason.NONE, ctx, first)


def _answer(params: ReleaseAndRetractParams, ctx: SkillContext) -> SwitchState:
    """Return the state of the switch within its timeout; UNKNOWN if it times out.

    If a success needs a switch that has timed out, the supervisor ends the run.
    """
    switch = ctx.observe().switch
    if switch is not SwitchState.UNKNOWN:
        return switch
    for seen in ctx.scan(params.answer_time):
        if seen.switch is not SwitchState.UNKNOWN:
            return seen.switch
        stay(ctx, seen.stamp)
    return switch


def let_go(opening: float, ctx: SkillContext) -> bool:
    """Open the hand in place; return True if the pads are further apart than the peg is thick.

    `is_gripping` alone is not sufficient, because a hand that does not grip can still enclose the peg.

    Args:
        opening: Distance between the pads that releases the peg, m.
        ctx: The skill's context.
    """
    ctx.devices.gripper.release(opening)
    for seen in ctx.scan(HAND_TIME, limited=False):
        if not seen.gripper.is_moving:
            break
        stay(ctx, seen.stamp)
    return ctx.observe().gripper.is_open(ctx.job.peg.part.thickness)


def _result(outcome: Outcome, reason: Reason, ctx: SkillContext, first: Observation) -> ReleaseAndRetractResult:
    last = ctx.observe()
    return ReleaseAndRetractResult(outcome, reason, last.stamp - first.stamp, last.switch is SwitchState.CLOSED)
