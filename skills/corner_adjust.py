"""Seat a square peg that is turned about as the hole is: upright, with small circles and turns that give way, pushing."""

import math
from dataclasses import dataclass

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from drivers.frames import angle_between, end_point, rotation_about
from drivers.quantities import ImpedanceSetpoint
from skills.contract import Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.ground import Plane, nominal
from skills.motion import VALIDITY, Gains, tilted_by
from skills.paths import dither
from skills.seating import depth_of, is_seated, require_short_of_bottom


class CornerAdjustParams(SkillParams):
    """How to work the peg in. Tactile measurements are not used."""

    gains: Gains
    """Stiffness and damping along x and y and in rotation."""
    push_stiffness: PositiveFloat
    """Stiffness along z, which makes the push, N/m."""
    push_damping: PositiveFloat
    """Damping along z, N·s/m."""
    push_offset: NonNegativeFloat
    """Depth of the tip's setpoint below the tip, m."""
    raise_rate: PositiveFloat
    """Rate at which the setpoint of the axis goes towards the normal, rad/s."""
    dither_radius: NonNegativeFloat
    """First radius of the circles that the finger centre draws, m; they fade."""
    dither_rate: PositiveFloat
    """Turning rate of the circles, rad/s."""
    dither_period: PositiveFloat
    """Time in which the circles fade, s."""
    turn: NonNegativeFloat
    """Angle by which the hand is asked to turn further than it has, to and fro, rad; times the stiffness it is the
    torque that it turns with, which the joints' friction takes most of."""
    turn_period: PositiveFloat
    """Period of turning to and fro, s."""
    timeout: PositiveFloat
    """Longest adjustment, s."""


@dataclass(frozen=True, slots=True)
class CornerAdjustResult(SkillResult):
    """Where the peg was when the adjustment ended."""

    depth: float
    """Of the tip below the surface by the arm, m."""


def run(params: CornerAdjustParams, ctx: SkillContext, plane: Plane | None = None) -> CornerAdjustResult:
    """Work the peg in until it is seated; `plane` as for `tactile_insert`."""
    plane = plane or nominal(ctx.job.hole)
    first, in_hand, identity, hole = ctx.observe(), ctx.in_hand(), ctx.new_id(), ctx.job.hole
    stiffness, damping = params.gains.stiffness(), params.gains.damping()
    stiffness[2], damping[2] = params.push_stiffness, params.push_damping
    start, tip = angle_between(first.axis, plane.normal), first.tip
    lean = first.axis - float(first.axis @ plane.normal) * plane.normal
    lean /= max(float(np.linalg.norm(lean)), 1e-9)
    for seen in ctx.scan(params.timeout, holding=True):
        # The angle is frozen: an estimate fed back while the peg is wedged would chase its own bias.
        tip, axis = end_point(seen.arm.tcp, in_hand.theta, in_hand.length)
        if is_seated(seen.switch, tip, hole):
            return CornerAdjustResult(Outcome.SUCCESS, Reason.NONE, seen.elapsed, depth_of(tip, hole))
        offset = dither(seen.elapsed, params.dither_radius, params.dither_rate, params.dither_period)
        left = max(start - params.raise_rate * seen.elapsed, 0.0)
        offset = offset + in_hand.length * (plane.normal[:2] + math.sin(left) * lean[:2])
        share = (seen.elapsed / params.turn_period) % 1.0
        turn = params.turn if share < 0.5 else -params.turn
        target = tip.copy()
        target[2] -= params.push_offset
        ctx.progress(seen.elapsed / params.timeout)
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=target,
                axis=tilted_by(offset, in_hand.length),
                roll=rotation_about(axis, turn) @ seen.arm.tcp.rotation[:, 2],
                stiffness=stiffness,
                damping=damping,
                valid_until=seen.stamp + VALIDITY,
                in_hand=in_hand,
            )
        )
    require_short_of_bottom(tip, hole)
    return CornerAdjustResult(Outcome.FAILURE, Reason.NOT_SEATED, params.timeout, depth_of(tip, hole))
