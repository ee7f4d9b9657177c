"""Free hand and arm after a failure: drop a held peg into the reject bin, but leave a seated peg in the hole.

    | state of the peg             | action                                                                          |
    | ---------------------------- | ------------------------------------------------------------------------------- |
    | held, clear of the plate     | raise it, drop it into the bin                                                  |
    | held, at the plate           | pull it along the estimated normal with a bounded force, because it may be in   |
    |                              | the hole; then drop it into the bin                                             |
    | held, in the hole, and stuck | release it, retract without it, report it as jammed: a person must remove it    |
    | or slipping out of the hand  |                                                                                 |
    | held, seated                 | release it and retract                                                          |
    | between the pads but not     | as for a peg that slips out of the hand, if its end may be in the hole          |
    | gripped                      |                                                                                 |
    | not in the hand              | raise the hand and open it; the supervisor decides if a person is needed        |

If the hand does not open, it never retracts from a peg that the hole holds.
"""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from drivers.config_model import Figure, Quantity, Source
from drivers.frames import UP
from drivers.parts import Point
from drivers.quantities import SwitchState, Vector
from skills.contract import Interrupted, Observation, Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.grasp_from_rack import ACROSS_RACK
from skills.motion import Goal, Transfer, move
from skills.pull_out import PullOut, pull_out
from skills.release_and_retract import let_go


class RecoverParams(SkillParams):
    """Parameters of the recovery."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    transfer: Annotated[Transfer, Figure(""), Field(exclude=True)] = Transfer()
    """Motion of the hand to the bin."""
    height: Annotated[float, Field(gt=0.0, le=0.3), Quantity("m")]
    """Distance to rise first, m."""
    bin: Annotated[Point, Quantity("m"), Source("set for each cell")]
    """Position above the reject bin for releasing the peg, m, base frame."""
    opening: Annotated[float, Field(gt=0.0, le=0.08), Quantity("m")]
    """Distance between the pads that releases the peg, m."""
    first: Annotated[bool, Source("decision 0021")] = False
    """True if a start with a peg in the hand first removes the peg; otherwise such a start is refused."""
    pull: Annotated[PullOut, Figure(""), Field(exclude=True)] = PullOut()
    """Motion that pulls a jammed peg out of the hole."""
    margin: Annotated[float, Figure("m"), Field(exclude=True)] = 0.01
    """Distance to keep from the edge of the workspace, m."""
    clear: Annotated[float, Figure("m"), Field(exclude=True)] = 0.005
    """Height of a held peg's end over the surface above which the hole cannot hold it, m."""


@dataclass(frozen=True, slots=True)
class RecoverResult(SkillResult):
    """Result of the recovery; `dropped` is True if a peg was dropped into the bin."""

    dropped: bool


def run(params: RecoverParams, ctx: SkillContext) -> RecoverResult:
    """Free the peg if possible, move the hand above the bin pointing down, and open it."""
    first = ctx.observe()
    held = first.gripper.is_gripping
    is_jammed = False
    if first.gripper.is_around(ctx.job.peg.part.thickness) and first.tip[2] < ctx.job.hole.centre[2] + params.clear:
        is_seated = first.switch is SwitchState.CLOSED
        is_jammed = not is_seated and _pull(params, ctx) is not None
        if is_seated or is_jammed:
            held = False
            # The arm holds still at its present pose: an arm that pulls would jump when the hand opens.
            ctx.devices.arm.halt()
            ctx.lead.held = None
            if not let_go(params.opening, ctx):
                return _result(Outcome.FAILURE, Reason.STILL_HELD, ctx, first, dropped=False)
    _draw_up(params, ctx)
    for _ in move(Goal(np.array(params.bin), UP, ACROSS_RACK), params.transfer, ctx, None):
        pass
    if not let_go(params.opening, ctx):
        return _result(Outcome.FAILURE, Reason.STILL_HELD, ctx, first, dropped=False)
    if is_jammed:
        return _result(Outcome.FAILURE, Reason.JAMMED, ctx, first, dropped=False)
    return _result(Outcome.SUCCESS, Reason.NONE, ctx, first, dropped=held)


def _pull(params: RecoverParams, ctx: SkillContext) -> Vector | None:
    """Pull the peg until its end is clear of the plate; return the tip if it is stuck or slips out of the hand, else None.

    The limits are not checked: contact forces left by the failure must first decay, and the pull itself is bounded.
    """
    try:
        return pull_out(ctx.job.hole.centre[2] + params.clear, params.pull, params.transfer.gains, ctx, limited=False)
    except Interrupted as interruption:
        if interruption.reason is not Reason.LOST_GRASP:
            raise
        return ctx.observe().tip


def _draw_up(params: RecoverParams, ctx: SkillContext) -> None:
    tcp = ctx.observe().arm.tcp
    low, high = np.array(ctx.limits.low), np.array(ctx.limits.high)
    inside = np.clip(tcp.position + UP * params.height, low + params.margin, high - params.margin)
    out = Goal(inside, -tcp.rotation[:, 0], tcp.rotation[:, 2])
    # The limits are not checked: the failure can have left the hand in contact or outside the workspace.
    for _ in move(out, params.transfer, ctx, None, limited=False):
        pass


def _result(outcome: Outcome, reason: Reason, ctx: SkillContext, first: Observation, dropped: bool) -> RecoverResult:
    return RecoverResult(outcome, reason, ctx.devices.clock.now() - first.stamp, dropped)
