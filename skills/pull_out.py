"""Take a peg out of the hole, in which it may jam, before another try: straight up, and shaken."""

from drivers.quantities import ImpedanceSetpoint, Vector
from skills.contract import SkillContext
from skills.motion import VALIDITY, Gains, tilted_by
from skills.paths import dither

SPEED = 0.05
"""At which the setpoint rises, m/s."""
SHARE = 0.625
"""Of the force limit, that the setpoint's lead over the tip pulls with at the most."""
SHAKEN = (0.003, 25.0, 0.5)
"""Radius of the circles that the finger centre draws meanwhile, m, their rate, rad/s, and the period in which they fade, s."""
LONGEST = 10.0
"""Longest pull, s."""


def pull_out(height: float, gains: Gains, ctx: SkillContext) -> Vector | None:
    """Pull the peg straight up until its tip stands at `height`, m, base frame, and not aside before.

    Returns:
        None where it came out; else the tip where it is stuck, shape (3,), m, base frame.
    """
    here = ctx.observe()
    identity, in_hand = ctx.new_id(), ctx.in_hand()
    most = SHARE * ctx.limits.force / gains.translation
    tip, target = here.tip, here.tip.copy()
    for seen in ctx.scan(LONGEST, holding=True):
        tip = seen.tip
        if tip[2] >= height:
            return None
        target[2] = min(target[2] + SPEED * ctx.scan_period, tip[2] + most)
        offset = dither(seen.elapsed, *SHAKEN)
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=target.copy(),
                axis=tilted_by(offset + in_hand.length * here.axis[:2], in_hand.length),
                roll=here.arm.tcp.rotation[:, 2],
                stiffness=gains.stiffness(),
                damping=gains.damping(),
                valid_until=seen.stamp + VALIDITY,
                in_hand=in_hand,
            )
        )
    return tip
