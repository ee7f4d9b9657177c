"""Push the peg and tilt it along a spiral about its end, which stays in place, without the skin: [gibbons], Sec. V.B."""

import numpy as np

from drivers.frames import end_point
from drivers.quantities import ImpedanceSetpoint
from skills.contract import Outcome, Reason, SkillContext
from skills.insert.spiral_adjust import SpiralAdjustResult
from skills.motion import VALIDITY, tilted_by
from skills.paper.equations import OFFSET
from skills.paper.params import PaperAdjustParams
from skills.paths import spiral
from skills.seating.decision import depth_of, is_seated, require_short_of_bottom


def run(params: PaperAdjustParams, ctx: SkillContext) -> SpiralAdjustResult:
    """Tilt the peg along a growing spiral about its end until the switch closes."""
    hole, first = ctx.job.hole, ctx.observe()
    K, D = params.gains.stiffness(), params.gains.damping_ratios()
    K[2], D[2] = params.push_stiffness, params.push_damping_ratio
    # The adjustment is open-loop: it uses the theta measured at its start.
    identity, in_hand, roll = ctx.new_id(), ctx.in_hand(), first.arm.tcp.rotation[:, 2]
    growth, offset, x_p, running = params.radius / params.growing_time, np.zeros(2), first.tip, 0.0
    for seen in ctx.scan(params.timeout, holding=True):
        running, (x_p, _) = seen.running, end_point(seen.arm.tcp, in_hand.theta, in_hand.length)
        if is_seated(seen.switch, depth_of(x_p, hole), hole):
            return _result(Outcome.SUCCESS, Reason.NONE, running, offset, depth_of(x_p, hole))
        # Offset of the finger centre from the vertical through the end: r (cos wt, sin wt), r = growth t.
        offset = spiral(seen.elapsed % params.growing_time, growth, params.turn_rate)
        ctx.callbacks.progress(seen.elapsed / params.timeout)
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=np.array([first.tip[0], first.tip[1], x_p[2] - OFFSET]),
                axis=tilted_by(offset, in_hand.length),
                roll=roll,
                stiffness=K,
                damping_ratio=D,
                valid_until=seen.stamp + VALIDITY,
                in_hand=in_hand,
            )
        )
    require_short_of_bottom(depth_of(x_p, hole), hole)
    return _result(Outcome.FAILURE, Reason.NOT_SEATED, running, offset, depth_of(x_p, hole))


def _result(outcome: Outcome, reason: Reason, elapsed: float, offset: np.ndarray, depth: float) -> SpiralAdjustResult:
    return SpiralAdjustResult(outcome, reason, elapsed, float(np.linalg.norm(offset)), depth)
