"""Follow a spray-paint path over the area until the skin measures a sudden change: [gibbons], Sec. IV."""

import numpy as np

from drivers.frames import rotation_about
from drivers.quantities import ImpedanceSetpoint, Twist, Vector
from skills.contract import Outcome, Reason, SkillContext
from skills.motion import VALIDITY, Goal
from skills.paper.equations import OFFSET, x_star
from skills.paper.hole_event import HoleEvent
from skills.paper.params import PaperSearchParams
from skills.paper.spray_paint import SprayPaint, spray_paint
from skills.pull_out import LONGEST, approach
from skills.search.params import SpraySearchParams
from skills.search.spray_search import SpraySearchResult


def run(params: PaperSearchParams, cell: SpraySearchParams, ctx: SkillContext) -> SpraySearchResult:
    """Search from a random point x_0 of the area until the skin detects the hole.

    Args:
        params: Parameters of the printed search.
        cell: Parameters of the cell's search; only approach, tilt and timeout are used.
        ctx: The skill's context.
    """
    hole = ctx.job.hole
    K, D = params.gains.stiffness(), params.gains.damping_ratios()
    K[2] = params.push_stiffness
    path = path_from(ctx.rng.uniform(-np.array(hole.area) / 2, np.array(hole.area) / 2), params, cell, ctx)
    x_0 = np.array([*(hole.centre[:2] + path.at(0.0)[0]), hole.centre[2] + cell.height])
    start, x_p = (float(x_0[0]), float(x_0[1])), x_0
    v, closing = ctx.job.peg.part.leaning(cell.tilt_azimuth, cell.tilt)
    if (stuck := approach(Goal(x_0, v, closing), cell.transfer, cell.pull, ctx)) is not None:
        return _result(Outcome.FAILURE, Reason.NOT_SEATED, LONGEST, stuck, start)
    identity, theta_0 = ctx.new_id(), ctx.in_hand().theta
    event, along = HoleEvent(params.threshold), 0.0
    for seen in ctx.scan(cell.timeout, holding=True):
        x_p, down = seen.tip, cell.descent * seen.elapsed / (cell.height + OFFSET)
        # x_p* moves down to an offset below the surface, then along the path.
        point, velocity = path.at(along)
        target = x_star(hole.centre[:2] + point, hole.centre[2])
        if down < 1.0:
            target[2] += (1.0 - down) * (cell.height + OFFSET)
            velocity = np.zeros(2)
        elif seen.is_new_frame and event.update(seen.frame):
            # x_h = x_p at the instant of the detection.
            return _result(Outcome.SUCCESS, Reason.NONE, seen.running, x_p, start)
        else:
            along += seen.step
        ctx.callbacks.progress(seen.running / cell.timeout)
        # The orientation of the hand stays constant: v* turns with the peg in the hand.
        turned = rotation_about(seen.arm.tcp.rotation[:, 2], seen.peg.theta - theta_0)
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=target,
                axis=turned @ v,
                roll=closing,
                stiffness=K,
                damping_ratio=D,
                valid_until=seen.stamp + VALIDITY,
                in_hand=ctx.in_hand(),
                twist=Twist(np.array([*velocity, 0.0]), np.zeros(3)),
            )
        )
    return _result(Outcome.FAILURE, Reason.NO_HOLE, cell.timeout, x_p, start)


def path_from(start: Vector, params: PaperSearchParams, cell: SpraySearchParams, ctx: SkillContext) -> SprayPaint:
    """Return the path over the area, starting at `start`, shape (2,), m, relative to the middle of the area."""
    hole = ctx.job.hole
    half = (hole.area[0] / 2, hole.area[1] / 2)
    pitch, fast = params.pitch * hole.part.inscribed, 0 if cell.fast_axis == "x" else 1
    return spray_paint(half, pitch, params.speed, fast, (float(start[0]), float(start[1])))


def _result(
    outcome: Outcome, reason: Reason, elapsed: float, x_p: Vector, start: tuple[float, float]
) -> SpraySearchResult:
    x, y, z = (float(each) for each in x_p)
    is_found = outcome is Outcome.SUCCESS
    return SpraySearchResult(
        outcome, reason, elapsed, (x, y, z), start, rests=int(is_found), plane=None, edge=(x, y) if is_found else None
    )
