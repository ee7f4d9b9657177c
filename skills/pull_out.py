"""Pull a peg out of the hole before another attempt, along the estimated normal and with a dither, because it may be jammed."""

from drivers.frames import UP
from drivers.quantities import ImpedanceSetpoint, Vector
from skills.contract import SkillContext
from skills.motion import VALIDITY, Gains, Goal, Transfer, move, tilted_by
from skills.paths import dither

SPEED = 0.05
"""Speed at which the setpoint rises, m/s."""
SHARE = 0.625
"""Largest pull from the setpoint's lead over the tip, fraction of the force limit."""
SHAKEN = (0.003, 25.0, 0.5)
"""Radius of the dither of the finger centre, m, its turning rate, rad/s, and its period, s."""
LONGEST = 10.0
"""Longest time to pull, s."""


def pull_out(height: float, gains: Gains, ctx: SkillContext, limited: bool = True) -> Vector | None:
    """Pull the peg along the plate's estimated normal until its tip is at `height`, m, base frame.

    Without a surface estimate, the pull is straight up.

    Args:
        height: Goal height of the tip, m, base frame.
        gains: Stiffness of the arm during the pull; the setpoint's lead over the tip bounds the force.
        ctx: The skill's context.
        limited: True to check the limits of force and workspace; False only for a motion out of a violation.

    Returns:
        None if the peg came out, otherwise the position of the stuck tip, shape (3,), m, base frame.
    """
    here = ctx.observe()
    identity, in_hand = ctx.new_id(), ctx.in_hand()
    most = SHARE * ctx.limits.force / gains.translation
    out = UP if ctx.peg.surface is None else ctx.peg.surface.normal
    tip, target = here.tip, here.tip
    for seen in ctx.scan(LONGEST, holding=True, limited=limited):
        tip = seen.tip
        if tip[2] >= height:
            return None
        # Setpoint: SPEED along the normal, with a lead over the tip of at most SHARE · force limit / stiffness
        target = target + SPEED * seen.step * out
        target = target - max(float(out @ (target - tip)) - most, 0.0) * out
        offset = dither(seen.elapsed, *SHAKEN)
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


def approach(goal: Goal, transfer: Transfer, ctx: SkillContext) -> Vector | None:
    """Move the peg above a point on the plate and zero the wrench there; if the tip is lower than the goal, pull it up first.

    Returns:
        None, or the position of the tip stuck in the hole, shape (3,), m, base frame.
    """
    if ctx.observe().tip[2] < goal.tip[2]:
        stuck = pull_out(goal.tip[2], transfer.gains, ctx)
        if stuck is not None:
            return stuck
    for _ in move(goal, transfer, ctx, ctx.in_hand()):
        pass
    ctx.zero_wrench()
    return None
