"""Seat a peg with corners that is turned as the hole is: upright, with a dither and small turns about its axis, under a
push.
"""

import math
from dataclasses import dataclass

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from drivers.frames import angle_between, end_point, rotation_about
from drivers.quantities import ImpedanceSetpoint, Twist, Vector
from skills.contract import Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.motion import VALIDITY, Gains, tilted_by
from skills.paths import dither
from skills.seating import depth_of, is_seated, require_short_of_bottom
from skills.surface import Plane, nominal


class CornerAdjustParams(SkillParams):
    """How to seat a peg with corners. The skill uses no tactile measurements.

    Source: chosen, not measured; reason in decision 0026.
    """

    gains: Gains
    """Stiffness and damping ratio along x and y and in rotation. Source: chosen within the margin that `cell check` prints."""
    push_stiffness: PositiveFloat
    """Stiffness along z, which makes the push, N/m."""
    push_damping_ratio: PositiveFloat
    """Damping along z, multiple of the critical one; the larger, the slower the peg arrives at the bottom."""
    push_offset: NonNegativeFloat
    """Depth of the tip's setpoint below the tip, m."""
    raise_rate: PositiveFloat
    """Rate at which the setpoint of the axis goes towards the normal, rad/s."""
    dither_radius: NonNegativeFloat
    """First radius of the dither of the finger centre, m; it fades within each period."""
    dither_rate: PositiveFloat
    """Turning rate of the dither, rad/s."""
    dither_period: PositiveFloat
    """Period of the dither, s; within it the radius fades to nothing."""
    turn: NonNegativeFloat
    """Angle by which the hand is asked to turn further than it has, to and fro, rad; times the stiffness it is the
    torque about the axis, most of which the joints' friction takes.
    """
    turn_period: PositiveFloat
    """Period of the turns to and fro, s."""
    timeout: PositiveFloat
    """Longest adjustment, s."""


@dataclass(frozen=True, slots=True)
class CornerAdjustResult(SkillResult):
    """Where the peg was when the adjustment ended."""

    depth: float
    """Depth of the tip below the surface by the arm, m."""


def run(params: CornerAdjustParams, ctx: SkillContext, plane: Plane | None = None) -> CornerAdjustResult:
    """Press the peg into the hole until it is seated; `plane` is the surface that the search estimated, None the job's
    own.
    """
    plane = plane or nominal(ctx.job.hole)
    first, in_hand, identity, hole = ctx.observe(), ctx.in_hand(), ctx.new_id(), ctx.job.hole
    stiffness, damping_ratio = params.gains.stiffness(), params.gains.damping_ratios()
    stiffness[2], damping_ratio[2] = params.push_stiffness, params.push_damping_ratio
    start, tip = angle_between(first.axis, plane.normal), first.tip
    lean = first.axis - float(first.axis @ plane.normal) * plane.normal
    lean /= max(float(np.linalg.norm(lean)), 1e-9)

    def axis_at(elapsed: float) -> Vector:
        left = max(start - params.raise_rate * elapsed, 0.0)
        offset = dither(elapsed, params.dither_radius, params.dither_rate, params.dither_period)
        return tilted_by(offset + in_hand.length * (plane.normal[:2] + math.sin(left) * lean[:2]), in_hand.length)

    for seen in ctx.scan(params.timeout, holding=True):
        # Theta is frozen: an estimate that is fed back while the peg is wedged would follow its own bias.
        tip, axis = end_point(seen.arm.tcp, in_hand.theta, in_hand.length)
        if is_seated(seen.switch, tip, hole):
            return CornerAdjustResult(Outcome.SUCCESS, Reason.NONE, seen.running, depth_of(tip, hole))
        upright, soon = (axis_at(seen.elapsed + later) for later in (0.0, ctx.scan_period))
        share = (seen.elapsed / params.turn_period) % 1.0
        turn = params.turn if share < 0.5 else -params.turn
        target = tip.copy()
        target[2] -= params.push_offset
        ctx.progress(seen.elapsed / params.timeout)
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=target,
                axis=upright,
                roll=rotation_about(axis, turn) @ seen.arm.tcp.rotation[:, 2],
                stiffness=stiffness,
                damping_ratio=damping_ratio,
                valid_until=seen.stamp + VALIDITY,
                in_hand=in_hand,
                twist=Twist(np.zeros(3), np.cross(upright, soon) / ctx.scan_period),
            )
        )
    require_short_of_bottom(tip, hole)
    return CornerAdjustResult(Outcome.FAILURE, Reason.NOT_SEATED, params.timeout, depth_of(tip, hole))
