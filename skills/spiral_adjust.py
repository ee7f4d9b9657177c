"""Keep the tip still and tilt the peg along a growing spiral, pushing, until it is seated: [gibbons], Sec. V.B."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.frames import end_point
from drivers.quantities import ImpedanceSetpoint
from skills.contract import Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.ground import Plane, nominal
from skills.motion import VALIDITY, Gains, tilted_by
from skills.paths import fading_circles, spiral
from skills.seating import OPEN_TOLERANCE, depth_of, is_seated, require_short_of_bottom

ARRIVING = 3.0
"""Damping along z close to the bottom, over that before."""


class SpiralAdjustParams(SkillParams):
    """How to tilt the peg about its tip; the spiral is drawn by the finger centre. Tactile measurements are not used."""

    growth: PositiveFloat
    """Growth of the spiral's radius at the finger centre, m/s."""
    turn_rate: PositiveFloat
    """Turns of the spiral, rad/s."""
    radius: PositiveFloat
    """Largest radius, m; `patience` may end the spiral before."""
    patience: Annotated[float, Field(gt=0.0, le=120.0)]
    """A peg that has not gone deeper by `jammed` for so long, s, is not in the hole, or will not go in so; close to the
    bottom the timeout alone counts."""
    timeout: PositiveFloat
    """Longest adjustment, s; where the radius is largest sooner, the spiral starts again."""
    gains: Gains
    """Along x and y, and in rotation."""
    push_stiffness: PositiveFloat
    """Along z, N/m."""
    push_damping: PositiveFloat
    """Along z, N·s/m: the push over this is the speed at which the peg arrives at the bottom."""
    push_offset: NonNegativeFloat
    """The tip's setpoint lies so far below its own height, m."""
    guided_depth: PositiveFloat
    """Once the tip is so deep, m, a growing spiral would only load its walls."""
    guided_radius: NonNegativeFloat
    """From there on the finger centre draws circles, m at first, fading: torque that friction holds jams."""
    guided_rate: PositiveFloat
    """Of those circles, rad/s."""
    guided_period: PositiveFloat
    """In which they fade, s."""
    jammed: NonNegativeFloat
    """Where the peg goes less deep in that period, m, the skin is asked again how it is held, and the peg is aimed where it
    rests, every other time: no torque is left but that of the circles."""
    arrival: NonNegativeFloat
    """This close to the bottom, m, the peg is damped more, so that it arrives without a blow."""


@dataclass(frozen=True, slots=True)
class SpiralAdjustResult(SkillResult):
    """How far the peg was tilted when the adjustment ended."""

    radius: float
    """Last commanded radius at the finger centre, m."""
    depth: float
    """Of the tip below the surface by the arm, m."""


def run(params: SpiralAdjustParams, ctx: SkillContext, plane: Plane | None = None) -> SpiralAdjustResult:
    """Tilt the peg along a growing spiral about its tip until it is seated; `plane` as for the insertion."""
    plane = plane or nominal(ctx.job.hole)
    first = ctx.observe()
    in_hand = ctx.in_hand()
    identity = ctx.new_id()
    roll = first.arm.tcp.rotation[:, 2]
    hole = ctx.job.hole
    stiffness, damping = params.gains.stiffness(), params.gains.damping()
    stiffness[2], damping[2] = params.push_stiffness, params.push_damping
    offset, tip, guided_since, is_guided = np.zeros(2), first.tip, math.inf, False
    periods, reached = 0, 0.0
    deepest, deepened = -math.inf, 0.0
    normal, is_by_plate = plane.normal, True
    elapsed = 0.0
    for seen in ctx.scan(params.timeout, holding=True):
        # The angle is frozen, but where the peg jams: fed back at every frame it would chase its own bias.
        tip, _ = end_point(seen.arm.tcp, in_hand.theta, in_hand.length)
        if is_seated(seen.switch, tip, hole):
            return SpiralAdjustResult(
                Outcome.SUCCESS,
                Reason.NONE,
                seen.elapsed,
                float(np.linalg.norm(offset)),
                depth_of(tip, hole),
            )
        elapsed = seen.elapsed
        depth = plane.depth(tip)
        if depth > deepest + params.jammed:
            deepest, deepened = depth, elapsed
        if elapsed - deepened > params.patience and depth_of(tip, hole) < hole.depth - OPEN_TOLERANCE:
            break
        is_guided = depth > params.guided_depth or is_guided
        if is_guided:
            guided_since = min(guided_since, elapsed)
            if int((elapsed - guided_since) / params.guided_period) > periods:
                periods, before, reached = periods + 1, reached, depth
                if reached - before < params.jammed:
                    # Where little of the plate was felt, the hole tells better than the plate how it stands.
                    in_hand, is_by_plate = ctx.in_hand(), not is_by_plate
                    tip, resting = end_point(seen.arm.tcp, in_hand.theta, in_hand.length)
                    reached, deepest = plane.depth(tip), deepest + plane.depth(tip) - depth
                    normal = plane.normal if is_by_plate else resting
            offset = fading_circles(
                elapsed - guided_since, params.guided_radius, params.guided_rate, params.guided_period
            )
        else:
            offset = spiral(elapsed % (params.radius / params.growth), params.growth, params.turn_rate)
        ctx.progress(elapsed / params.timeout)
        is_arriving = depth_of(tip, hole) > hole.depth - params.arrival
        damping[2] = ARRIVING * params.push_damping if is_arriving else params.push_damping
        target = (tip if is_guided else first.tip).copy()
        target[2] = tip[2] - params.push_offset
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=target,
                axis=tilted_by(offset + in_hand.length * normal[:2], in_hand.length),
                roll=roll,
                stiffness=stiffness,
                damping=damping.copy(),
                valid_until=seen.stamp + VALIDITY,
                in_hand=in_hand,
            )
        )
    require_short_of_bottom(tip, hole)
    return SpiralAdjustResult(
        Outcome.FAILURE, Reason.NOT_SEATED, elapsed, float(np.linalg.norm(offset)), depth_of(tip, hole)
    )
