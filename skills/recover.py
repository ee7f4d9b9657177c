"""Free hand and arm after a failure; what the hand holds goes to the reject bin, but a seated peg is left where it is.

    | where the peg is            | what is done                                                                      |
    | --------------------------- | --------------------------------------------------------------------------------- |
    | in the hand, clear of all   | draw up, drop it into the bin                                                       |
    | in the hand, at the plate   | pull it along the hole's axis, as far as that is known, with the force bounded, as  |
    |                             | it may be in the hole; then the bin                                               |
    | in the hand, in the hole,   | let go of it, draw back without it, and say that it is jammed: a person must         |
    | and it does not come out,   | take it out                                                                         |
    | or slips out of the hand    |                                                                                   |
    | in the hand, seated         | let go of it and draw back                                                          |
    | in a hand that is as wide   | as one that slips out of the hand, if its end may be in the hole                     |
    | as the peg but does not grip|                                                                                   |
    | nowhere in the hand         | draw up, open the hand; whether a person is needed the supervisor says               |

A hand that does not open is never drawn away from a peg that the hole holds.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.frames import UP
from drivers.parts import Point
from drivers.quantities import SwitchState, Vector
from skills.contract import Interrupted, Observation, Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.grasp_from_rack import ACROSS_RACK
from skills.motion import Goal, Transfer, move
from skills.pull_out import pull_out
from skills.release_and_retract import let_go

MARGIN = 0.01
"""Distance that is kept from the edge of the workspace, m."""
CLEAR = 0.005
"""Height of a held peg's end over the surface from which on nothing can hold it, m."""


class RecoverParams(SkillParams):
    """How to come back.

    Source: chosen, not measured.
    """

    transfer: Transfer
    """How the hand goes to the bin."""
    height: Annotated[float, Field(gt=0.0, le=0.3)]
    """Distance to draw up first, m."""
    bin: Point
    """Place above the reject bin where the peg is let go, m, base frame. Source: set for each cell."""
    opening: Annotated[float, Field(gt=0.0, le=0.08)]
    """Distance between the pads that lets the peg go, m."""
    opening_time: Annotated[float, Field(gt=0.0, le=10.0)]
    """Longest time for the fingers to open, s."""
    first: bool = False
    """Whether a start that finds a peg in the hand clears it away first, instead of being refused. Source: decision 0021."""


@dataclass(frozen=True, slots=True)
class RecoverResult(SkillResult):
    """Whether a peg was dropped into the bin."""

    dropped: bool


def run(params: RecoverParams, ctx: SkillContext) -> RecoverResult:
    """Free the peg where it can be freed, turn the hand down above the bin, open it."""
    first = ctx.observe()
    held = first.gripper.is_gripping
    is_jammed = False
    if first.gripper.is_around(ctx.job.peg.part.thickness) and first.tip[2] < ctx.job.hole.centre[2] + CLEAR:
        is_seated = first.switch is SwitchState.CLOSED
        is_jammed = not is_seated and _pull(params, ctx) is not None
        if is_seated or is_jammed:
            held = False
            _relax(ctx)
            if not let_go(params.opening, params.opening_time, ctx):
                return _result(Outcome.FAILURE, Reason.STILL_HELD, ctx, first, dropped=False)
    _draw_up(params, ctx)
    for _ in move(Goal(np.array(params.bin), UP, ACROSS_RACK), params.transfer, ctx, None):
        pass
    if not let_go(params.opening, params.opening_time, ctx):
        return _result(Outcome.FAILURE, Reason.STILL_HELD, ctx, first, dropped=False)
    if is_jammed:
        return _result(Outcome.FAILURE, Reason.JAMMED, ctx, first, dropped=False)
    return _result(Outcome.SUCCESS, Reason.NONE, ctx, first, dropped=held)


def _pull(params: RecoverParams, ctx: SkillContext) -> Vector | None:
    """Pull the peg out until its end is clear of the plate; return where it is stuck or slips out of the hand, or None.

    The limits do not count here: what the failure left pressed must first be able to give way, and the pull is bounded.
    """
    try:
        return pull_out(ctx.job.hole.centre[2] + CLEAR, params.transfer.gains, ctx, limited=False)
    except Interrupted as interruption:
        if interruption.reason is not Reason.LOST_GRASP:
            raise
        return ctx.observe().tip


def _relax(ctx: SkillContext) -> None:
    """Let the arm hold still where it is; the hand of an arm that pulls would leap when it lets go."""
    ctx.arm.halt()
    ctx.held = None


def _draw_up(params: RecoverParams, ctx: SkillContext) -> None:
    tcp = ctx.observe().arm.tcp
    low, high = np.array(ctx.limits.low), np.array(ctx.limits.high)
    inside = np.clip(tcp.position + UP * params.height, low + MARGIN, high - MARGIN)
    out = Goal(inside, -tcp.rotation[:, 0], tcp.rotation[:, 2])
    # What the failure left pressed or outside must first be free to move away.
    for _ in move(out, params.transfer, ctx, None, limited=False):
        pass


def _result(outcome: Outcome, reason: Reason, ctx: SkillContext, first: Observation, dropped: bool) -> RecoverResult:
    return RecoverResult(outcome, reason, ctx.clock.now() - first.stamp, dropped)
