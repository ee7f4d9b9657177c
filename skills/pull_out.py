"""Pull a peg out of the hole before another attempt, along the estimated normal and with a dither, because it may be jammed."""

import math
from typing import Annotated, ClassVar

from pydantic import Field

from drivers.config_model import ConfigModel, Figure, Tempo
from drivers.frames import UP
from drivers.quantities import ImpedanceSetpoint, Vector
from skills.contract import SkillContext
from skills.motion import VALIDITY, Gains, Goal, Transfer, move, tilted_by
from skills.paths import dither

LONGEST = 10.0
"""Longest time to pull, s. Source: chosen, not measured."""


class PullOut(ConfigModel):
    """Motion that pulls a peg out of a hole."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    speed: Annotated[float, Figure("m/s", Tempo.SPEED), Field(exclude=True)] = 0.05
    """Speed at which the setpoint rises, m/s."""
    dither_radius: Annotated[float, Figure("m"), Field(exclude=True)] = 0.003
    """Largest radius of the dither of the finger centre, m."""
    dither_rate: Annotated[float, Figure("rad/s", Tempo.SPEED, "dither_radius"), Field(exclude=True)] = 25.0
    """Turning rate of the dither, rad/s."""
    dither_period: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True)] = 0.5
    """Period of the dither, s."""
    share: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.625
    """Largest pull from the setpoint's lead over the tip, fraction of the force limit."""
    near: Annotated[float, Figure("m"), Field(exclude=True)] = 5e-3
    """Largest distance of the tip from its goal above the plate, m. The arm itself errs by 0.4 mm, and by up to 6 mm with doubled errors."""
    moves: Annotated[int, Figure("count"), Field(exclude=True)] = 2
    """Largest number of moves to this goal. If the peg turned in the hand during the pull, the first move used an old angle."""


def pull_out(height: float, pull: PullOut, gains: Gains, ctx: SkillContext, limited: bool = True) -> Vector | None:
    """Pull the peg along the plate's estimated normal until its tip is at `height`, m, base frame.

    Without a surface estimate, the pull is straight up.

    Args:
        height: Goal height of the tip, m, base frame.
        pull: Speed and dither of the pull.
        gains: Stiffness of the arm during the pull; the setpoint's lead over the tip bounds the force.
        ctx: The skill's context.
        limited: True to check the limits of force and workspace; False only for a motion out of a violation.

    Returns:
        None if the peg came out, otherwise the position of the stuck tip, shape (3,), m, base frame.
    """
    here = ctx.observe()
    identity, in_hand = ctx.new_id(), ctx.in_hand()
    most = pull.share * ctx.limits.force / gains.translation
    out = UP if ctx.peg.surface is None else ctx.peg.surface.normal
    tip, target = here.tip, here.tip
    for seen in ctx.scan(LONGEST, holding=True, limited=limited):
        tip = seen.tip
        if tip[2] >= height:
            return None
        # Setpoint: pull.speed along the normal, with a lead over the tip of at most pull.share · force limit / stiffness
        target = target + pull.speed * seen.step * out
        target = target - max(float(out @ (target - tip)) - most, 0.0) * out
        offset = dither(seen.elapsed, pull.dither_radius, pull.dither_rate, pull.dither_period)
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=target,
                axis=tilted_by(offset + in_hand.length * here.axis[:2], in_hand.length),
                roll=here.arm.tcp.rotation[:, 2],
                stiffness=gains.stiffness(),
                damping_ratio=gains.damping_ratios(),
                valid_until=seen.stamp + VALIDITY,
                in_hand=in_hand,
            )
        )
    return tip


def approach(goal: Goal, transfer: Transfer, pull: PullOut, ctx: SkillContext) -> Vector | None:
    """Move the peg above a point on the plate and zero the wrench there; if the tip is lower than the goal, pull it up first.

    Returns:
        None, or the position of the tip stuck in the hole, shape (3,), m, base frame.
    """
    if ctx.observe().tip[2] < goal.tip[2]:
        stuck = pull_out(goal.tip[2], pull, transfer.gains, ctx)
        if stuck is not None:
            return stuck
    for _ in range(pull.moves):
        for _ in move(goal, transfer, ctx, ctx.in_hand()):
            pass
        if math.dist(ctx.observe().tip, goal.tip) <= pull.near:
            break
    ctx.wrench.set_zero()
    return None
