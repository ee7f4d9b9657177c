"""Raise a peg with corners, one of which is in a hole that is turned by an unknown angle, and turn it until it drops in.

The peg is raised over its leading corner to a small tilt. There it stands only as deep as its corner reaches unless it is
turned as the hole is, to within the clearance; then it can sink to where its faces meet the walls. The hand turns
it to and fro about the plate's normal, the corner pushed towards the hole's own, until the tip sinks.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.frames import angle_between, rotation_about
from drivers.quantities import ImpedanceSetpoint, Vector
from skills.contract import Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.ground import Plane, nominal
from skills.motion import VALIDITY, Gains
from skills.paths import dither
from skills.seating import is_seated


class CornerInsertParams(SkillParams):
    """How to raise and turn the peg."""

    gains: Gains
    """Stiffness and damping along x and y and in rotation."""
    push_stiffness: PositiveFloat
    """Stiffness along z, which makes the push, N/m."""
    push_back: Annotated[float, Field(gt=0.0, le=1.0)]
    """Share of the push that is kept while the peg is raised, fraction; raised in the hole it turns in the hand."""
    push_damping: PositiveFloat
    """Damping along z, N·s/m."""
    push_offset: NonNegativeFloat
    """Depth of the tip's setpoint below the tip, m."""
    lead: tuple[NonNegativeFloat, NonNegativeFloat]
    """Distance of the tip's setpoint ahead of the tip, along the closing axis and across it, m; the corner shall stay
    in the hole's own. A push across turns the peg in the hand."""
    tilt: Annotated[float, Field(gt=0.0, lt=0.4)]
    """Tilt to which the peg is raised, rad."""
    integral_gain: NonNegativeFloat
    """Integral gain on orientation, N·m/(rad·s); K_I of [gibbons], Eq. (6)."""
    integral_limit: NonNegativeFloat
    """Saturation of the integral, N·m."""
    settle: NonNegativeFloat
    """Time to settle after the setpoint is raised, s."""
    raise_rate: PositiveFloat
    """Rate at which the setpoint of the axis is raised, rad/s."""
    turn_rate: PositiveFloat
    """Rate of the yaw sweep's setpoint about the normal, rad/s; while it is turned as the hole is, the peg must have
    time to sink."""
    centres: Annotated[tuple[Annotated[float, Field(ge=-1.0, le=1.0)], ...], Field(min_length=1)]
    """Middle of the yaw sweep in the first attempt, in the next, and so on, fraction of the most that the hole can be
    turned; far from how the hole is turned the corner would climb out."""
    yaw_sweep: Annotated[float, Field(ge=0.0, le=1.0)]
    """Reach of the yaw sweep to either side, fraction of the most that the hole can be turned; no less than `felt`, or
    walls would never be felt."""
    margin: NonNegativeFloat
    """Addition to the reach of the yaw sweep, rad."""
    dither_radius: NonNegativeFloat
    """First radius of the circles that the finger centre draws all the while, m; they fade, and shake friction loose.
    """
    dither_rate: PositiveFloat
    """Turning rate of the circles, rad/s."""
    dither_period: PositiveFloat
    """Time in which the circles fade, s."""
    growth: PositiveFloat
    """Angle by which every turn to one side reaches further than the last, rad; the hole is rather turned little."""
    felt: PositiveFloat
    """Angle by which the hand lags behind its setpoint about the normal when walls hold the peg, rad; many times what
    the joints' friction explains."""
    sunk: PositiveFloat
    """Distance that the tip sinks when the peg drops in all the same, m."""
    strayed: PositiveFloat
    """Distance of the tip from where it was raised at which it is out of the hole, m."""
    lost_height: PositiveFloat
    """Height of the corner above the surface at which it is out of the hole, m."""
    timeout: PositiveFloat
    """Longest insertion, s."""


@dataclass(frozen=True, slots=True)
class CornerInsertResult(SkillResult):
    """How the peg was turned when it sank."""

    yaw: float
    """About the plate's normal since the beginning, rad."""
    phi: float
    """Angle to the normal, rad, by the skin."""


def run(
    params: CornerInsertParams, ctx: SkillContext, plane: Plane | None = None, attempt: int = 0
) -> CornerInsertResult:
    """Bring the peg to where it is turned as the hole is; `plane` as for `tactile_insert`, attempts counted from 0."""
    plane = plane or nominal(ctx.job.hole)
    normal, side = plane.normal, ctx.job.peg.part.widest
    first = ctx.observe()
    closing = first.arm.tcp.rotation[:, 2]
    about = np.cross(normal, first.axis)
    about /= max(float(np.linalg.norm(about)), 1e-9)
    ahead = np.cross(about, normal)
    raised = rotation_about(about, params.tilt - angle_between(normal, first.axis))
    axis, roll = raised @ first.axis, raised @ closing
    identity = ctx.new_id()
    stiffness, damping = params.gains.stiffness(), params.gains.damping()
    stiffness[2], damping[2] = params.push_stiffness, params.push_damping
    leads = lead_to(ahead, roll, normal, params.lead)
    swing = angle_between(first.axis, axis)
    anchor: Vector | None = None
    since = swing / params.raise_rate + params.settle
    reach = max(params.yaw_sweep * ctx.job.hole.yaw, params.felt) + params.margin
    highest, yaw, phi = -math.inf, 0.0, params.tilt
    centre = params.centres[attempt % len(params.centres)] * ctx.job.hole.yaw
    for seen in ctx.scan(params.timeout, holding=True):
        phi, elapsed = angle_between(seen.axis, normal), seen.elapsed
        if is_seated(seen.switch, seen.tip, ctx.job.hole):
            return CornerInsertResult(Outcome.SUCCESS, Reason.NONE, elapsed, yaw, phi)
        depth = plane.depth(seen.tip)
        if depth < -params.lost_height - side * math.sin(phi):
            return CornerInsertResult(Outcome.FAILURE, Reason.NOT_ALIGNED, elapsed, yaw, phi)
        left = max(swing - params.raise_rate * elapsed, 0.0)
        yaw = centre * min(elapsed / since, 1.0)
        stiffness[2] = params.push_stiffness * (params.push_back if elapsed < since else 1.0)
        if elapsed >= since:
            anchor = seen.tip if anchor is None else anchor
            yaw = centre + to_and_fro(elapsed - since, params.turn_rate, params.growth, reach)
            highest = max(highest, -depth)
            if float(np.linalg.norm(seen.tip - anchor)) > params.strayed:
                return CornerInsertResult(Outcome.FAILURE, Reason.NOT_ALIGNED, elapsed, yaw, phi)
            turn = turned_by(seen.arm.tcp.rotation[:, 2], roll, normal)
            if abs(yaw - turn) > params.felt or highest + depth > params.sunk:
                return CornerInsertResult(Outcome.SUCCESS, Reason.NONE, elapsed, yaw, phi)
        turned = rotation_about(normal, yaw)
        leaning = turned @ rotation_about(about, left)
        if elapsed >= since:
            shaken = (
                dither(elapsed - since, params.dither_radius, params.dither_rate, params.dither_period)
                / ctx.job.peg.length
            )
            leaning = tipped(shaken) @ leaning
        ctx.progress(elapsed / params.timeout)
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=seen.tip + turned @ leads - params.push_offset * normal,
                axis=leaning @ axis,
                roll=leaning @ roll,
                stiffness=stiffness.copy(),
                damping=damping,
                valid_until=seen.stamp + VALIDITY,
                in_hand=ctx.in_hand(),
                integral_gain=params.integral_gain,
                integral_limit=params.integral_limit,
            )
        )
    return CornerInsertResult(Outcome.FAILURE, Reason.NOT_ALIGNED, params.timeout, yaw, phi)


def lead_to(ahead: Vector, roll: Vector, normal: Vector, leads: tuple[float, float]) -> Vector:
    """Return how far to lead along the closing axis `roll` and across it, to the side of `ahead`, in the plane, shape (3,), m."""
    along = roll - float(roll @ normal) * normal
    along /= float(np.linalg.norm(along))
    across = np.cross(normal, along)
    lead: Vector = math.copysign(leads[0], ahead @ along) * along + math.copysign(leads[1], ahead @ across) * across
    return lead


def tipped(offset: Vector) -> Vector:
    """Return the rotation that tips what is upright by `offset`, shape (2,), rad, towards x and y; shape (3, 3)."""
    size = math.hypot(offset[0], offset[1])
    return rotation_about(np.array([-offset[1], offset[0], 0.0]) / size, size) if size > 1e-9 else np.eye(3)


def turned_by(now: Vector, before: Vector, normal: Vector) -> float:
    """Return the angle about `normal` from `before` to `now`, rad; all unit, shape (3,)."""
    along = float(normal @ now) * float(normal @ before)
    return math.atan2(float(normal @ np.cross(before, now)), float(before @ now) - along)


def to_and_fro(time: float, rate: float, growth: float, reach: float) -> float:
    """Return the angle after `time` of turning at constant `rate` from 0 to one side, the other, and so on, rad.

    Every turn reaches by `growth` further than the last, at the most as far as `reach`.
    """
    way, end, side = rate * time, 0.0, 1.0
    while True:
        far = side * min(abs(end) + growth, reach)
        if way <= abs(far - end):
            return end + side * way
        way -= abs(far - end)
        end, side = far, -side
