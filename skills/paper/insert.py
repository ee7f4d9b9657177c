"""Align the peg with the plate's normal while its end is in the hole: [gibbons], Sec. V.A, Eq. (4)-(7)."""

import math

from drivers.frames import UP, angle_between
from drivers.quantities import ImpedanceSetpoint
from skills.contract import Outcome, Reason, SkillContext
from skills.insert.tactile_insert import TactileInsertResult
from skills.motion import VALIDITY
from skills.paper.equations import k_33, towards, x_star
from skills.paper.params import PaperInsertParams
from skills.seating.decision import depth_of, is_seated

ALIGNED = math.radians(15.0)
"""Angle phi below which the adjustment starts, rad. Source: [gibbons], Sec. VII."""


def run(params: PaperInsertParams, ctx: SkillContext) -> TactileInsertResult:
    """Align the peg with v* = [0 0 1]^T, its end in the hole, until phi < `ALIGNED` or the peg is seated."""
    hole, first, v_star = ctx.job.hole, ctx.observe(), UP
    K, D = params.gains.stiffness(), params.gains.damping_ratios()
    identity, roll = ctx.new_id(), first.arm.tcp.rotation[:, 2]
    x_p_star = x_star(first.tip, hole.centre[2])
    phi = phi_0 = angle_between(first.axis, v_star)
    for seen in ctx.scan(params.timeout, holding=True):
        # phi = arccos(v . v*); computed as atan2(|v x v*|, v . v*)
        phi = angle_between(seen.axis, v_star)
        if phi < ALIGNED or is_seated(seen.switch, depth_of(seen.tip, hole), hole):
            return TactileInsertResult(Outcome.SUCCESS, Reason.NONE, seen.running, phi_0, phi)
        ctx.callbacks.progress(1.0 - min(phi / phi_0, 1.0))
        K[2] = k_33(phi, phi_0, *params.push_stiffness)
        # Eq. (5): e = [x_p - x_p*; (v x v*) phi], with the order of the cross product corrected, and
        # Eq. (6): tau = J_p^T (-K e - K_I int(e) - D J_p dq/dt), both evaluated by the arm's law at 1 kHz
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=x_p_star,
                axis=towards(seen.axis, v_star),
                roll=roll,
                stiffness=K.copy(),
                damping_ratio=D,
                valid_until=seen.stamp + VALIDITY,
                in_hand=ctx.in_hand(),
                integral_gain=params.integral_gain,
                integral_limit=params.integral_limit,
            )
        )
    return TactileInsertResult(Outcome.FAILURE, Reason.NOT_ALIGNED, params.timeout, phi_0, phi)
