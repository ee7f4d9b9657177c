"""Raise a peg with corners, one of which is in a hole that is turned by an unknown angle, and turn it until it drops
in.

The peg is raised over its leading corner to a small tilt. There it stands only as deep as its corner reaches, unless it
is turned as the hole is, to within the clearance; then it can sink until its faces meet the walls. The hand sweeps its
yaw to and fro about the plate's normal, with the corner pushed towards the hole's own, until the tip sinks.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.frames import angle_between, rotation_about
from drivers.quantities import ImpedanceSetpoint, Twist, Vector
from skills.contract import Observation, Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.motion import VALIDITY, Gains, spin_between
from skills.paths import dither
from skills.seating import is_seated
from skills.surface import Plane, nominal


class CornerInsertParams(SkillParams):
    """How to raise and turn the peg.

    Source: chosen, not measured; reason in docs/tried/corners.md.
    """

    gains: Gains
    """Stiffness and damping ratio along x and y and in rotation. Source: chosen within the margin that `cell check` prints."""
    push_stiffness: PositiveFloat
    """Stiffness along z, which makes the push, N/m."""
    push_back: Annotated[float, Field(gt=0.0, le=1.0)]
    """Share of the push that is kept while the peg is raised, fraction; under the full push a peg that is raised in the
    hole turns in the hand, under too small a one the push ahead lifts its corner over the edge. Source: docs/tried/corners.md.
    """
    push_offset: NonNegativeFloat
    """Depth of the tip's setpoint below the tip, m."""
    lead: tuple[NonNegativeFloat, NonNegativeFloat]
    """Distance of the tip's setpoint ahead of the tip, along the closing axis and across it, m; it keeps the corner in
    the hole's own. A push across the closing axis turns the peg in the hand.
    """
    tilt: Annotated[float, Field(gt=0.0, lt=0.4)]
    """Tilt to which the peg is raised, rad. Source: docs/tried/corners.md."""
    follow_rate: PositiveFloat = 2.0
    """Rate at which the hand turns after a peg that has turned in it, 1/s; where walls hold the tip, a hand that turned after it at once would
    only turn in its pads. Source: docs/tried/search.md.
    """
    integral_gain: NonNegativeFloat
    """Integral gain on orientation, N·m/(rad·s); K_I of [gibbons], Eq. (6)."""
    integral_limit: NonNegativeFloat
    """Saturation of the integral, N·m."""
    settle: NonNegativeFloat
    """Time to settle after the setpoint is raised, s."""
    raise_rate: PositiveFloat
    """Rate at which the setpoint of the axis is raised, rad/s."""
    raise_stop: NonNegativeFloat = 0.3
    """Time in which the setpoint of the raised axis comes to a stand, s; where it stops at once the hand's inertia draws the corner back along the
    closing axis by 2 mm. Source: docs/tried/corners.md.
    """
    press: NonNegativeFloat = 0.003
    """Distance of the tip's setpoint ahead of the tip along the closing axis once the peg is raised, m; it has to exceed what friction of joints and
    plate holds. The pads stand square to it. Source: docs/tried/corners.md.
    """
    turn_rate: PositiveFloat
    """Rate of the yaw sweep's setpoint about the normal, rad/s; slow enough for the peg to sink while it is turned as
    the hole is.
    """
    centres: Annotated[tuple[Annotated[float, Field(ge=-1.0, le=1.0)], ...], Field(min_length=1)]
    """Middle of the yaw sweep in the first attempt, in the next, and so on, fraction of the most that the hole can be
    turned; the corner climbs out of the hole where the sweep goes far beyond the hole's own yaw.
    """
    yaw_sweep: Annotated[float, Field(ge=0.0, le=1.0)]
    """Reach of the yaw sweep to either side, fraction of the most that the hole can be turned; it has to reach `felt`,
    or the hand never lags far enough to tell a wall.
    """
    margin: NonNegativeFloat
    """Addition to the reach of the yaw sweep, rad."""
    dither_radius: NonNegativeFloat
    """First radius of the dither of the finger centre, m; it fades within each period and frees the peg of static
    friction.
    """
    dither_rate: PositiveFloat
    """Turning rate of the dither, rad/s."""
    dither_period: PositiveFloat
    """Period of the dither, s; within it the radius fades to nothing."""
    growth: PositiveFloat
    """Angle by which every turn to one side reaches further than the last, rad; small yaws of the hole are the
    likeliest and are tried first.
    """
    felt: PositiveFloat
    """Angle by which the hand lags behind its setpoint about the normal when walls hold the peg, rad; many times the
    lag that the joints' friction causes. Source: docs/tried/corners.md.
    """
    sunk: PositiveFloat
    """Distance by which the tip sinks when the peg drops in without a wall having been felt, m."""
    strayed: PositiveFloat
    """Distance of the tip from where it was raised at which it has left the hole, m."""
    lost_height: PositiveFloat
    """Height of the corner above the surface at which it has left the hole, m."""
    timeout: PositiveFloat
    """Longest insertion, s."""


@dataclass(frozen=True, slots=True)
class CornerInsertResult(SkillResult):
    """How the peg was turned when it sank."""

    yaw: float
    """Yaw of the peg about the plate's normal since the beginning, rad."""
    phi: float
    """Angle between the peg and the normal by the skin, rad."""


@dataclass(frozen=True, slots=True, eq=False)
class Raised:
    """The attitude to which the peg is raised before its yaw is swept."""

    normal: Vector
    """Normal of the plate, unit, shape (3,), base frame."""
    about: Vector
    """Axis about which the peg is raised, unit, shape (3,), base frame."""
    axis: Vector
    """Axis of the raised peg, unit, shape (3,), base frame."""
    roll: Vector
    """Closing axis of the hand at the raised peg, unit, shape (3,), base frame."""
    lead: Vector
    """Lead of the tip's setpoint before any yaw, shape (3,), m, base frame."""
    along: Vector
    """Direction in the plate along the closing axis towards the hole's own corner before any yaw, unit, shape (3,), base frame."""
    swing: float
    """Angle by which the peg is raised, rad; negative where it is lowered to the tilt that it shall have."""
    risen: float
    """Time of running at which the peg's setpoint is raised, s."""
    settled: float
    """Time of running at which the peg is raised and has settled, s; the yaw sweep then begins."""


@dataclass(frozen=True, slots=True, eq=False)
class YawSweep:
    """The yaw sweep of one attempt, and what it has met."""

    centre: float
    """Middle of the sweep, rad."""
    reach: float
    """Largest angle to either side of the middle, rad."""
    most: float = math.inf
    """Largest yaw that is asked for, rad: no hole is turned further."""
    anchor: Vector | None = None
    """Place of the tip when the sweep began, shape (3,), m, base frame; None before."""
    highest: float = -math.inf
    """Largest height of the tip above the surface in the sweep, m."""

    def after(self, tip: Vector, depth: float) -> "YawSweep":
        """Return the sweep after a scan with the tip at `depth`, m, below the surface."""
        anchor = tip if self.anchor is None else self.anchor
        return replace(self, anchor=anchor, highest=max(self.highest, -depth))

    def distance(self, tip: Vector) -> float:
        """Return the distance of the tip from where the sweep began, m; 0 before."""
        return 0.0 if self.anchor is None else float(np.linalg.norm(tip - self.anchor))

    def yaw(self, elapsed: float, settled: float, params: CornerInsertParams) -> float:
        """Return the yaw's setpoint, rad; until the peg has settled it goes to the middle of the sweep."""
        if elapsed < settled:
            return self.centre * min(elapsed / settled, 1.0)
        yaw = self.centre + to_and_fro(elapsed - settled, params.turn_rate, params.growth, self.reach)
        return min(max(yaw, -self.most), self.most)


def run(
    params: CornerInsertParams, ctx: SkillContext, plane: Plane | None = None, attempt: int = 0
) -> CornerInsertResult:
    """Sweep the yaw until the peg is turned as the hole is and drops in; `plane` is the surface that the search
    estimated, None the job's own.
    """
    plane = plane or nominal(ctx.job.hole)
    raised = raise_from(ctx.observe(), plane.normal, params)
    sweep = sweep_of(params, ctx.job.hole.yaw, attempt)
    identity = ctx.new_id()
    yaw, phi, theta = 0.0, params.tilt, ctx.in_hand().theta
    for seen in ctx.scan(params.timeout, holding=True):
        phi, elapsed = angle_between(seen.axis, plane.normal), seen.elapsed
        if is_seated(seen.switch, seen.tip, ctx.job.hole):
            return CornerInsertResult(Outcome.SUCCESS, Reason.NONE, seen.running, yaw, phi)
        depth = plane.depth(seen.tip)
        if depth < -params.lost_height - ctx.job.peg.part.widest * math.sin(phi):
            return CornerInsertResult(Outcome.FAILURE, Reason.NOT_ALIGNED, seen.running, yaw, phi)
        yaw = sweep.yaw(elapsed, raised.settled, params)
        if elapsed >= raised.settled:
            sweep = sweep.after(seen.tip, depth)
            if sweep.distance(seen.tip) > params.strayed:
                return CornerInsertResult(Outcome.FAILURE, Reason.NOT_ALIGNED, seen.running, yaw, phi)
            turn = turned_by(seen.arm.tcp.rotation[:, 2], raised.roll, plane.normal)
            if abs(yaw - turn) > params.felt or sweep.highest + depth > params.sunk:
                return CornerInsertResult(Outcome.SUCCESS, Reason.NONE, seen.running, yaw, phi)
        ctx.progress(elapsed / params.timeout)
        theta += min(params.follow_rate * seen.step, 1.0) * (seen.peg.theta - theta)
        ctx.follow(_setpoint(params, ctx, seen, raised, sweep, identity, theta))
    return CornerInsertResult(Outcome.FAILURE, Reason.NOT_ALIGNED, params.timeout, yaw, phi)


def raise_from(seen: Observation, normal: Vector, params: CornerInsertParams) -> Raised:
    """Return the attitude to which the peg is raised from where it is seen, over the corner that leads."""
    about = np.cross(normal, seen.axis)
    about /= max(float(np.linalg.norm(about)), 1e-9)
    turn = rotation_about(about, params.tilt - angle_between(normal, seen.axis))
    axis, roll = turn @ seen.axis, turn @ seen.arm.tcp.rotation[:, 2]
    size, ahead = angle_between(seen.axis, axis), np.cross(about, normal)
    lead, along = lead_to(ahead, roll, normal, params.lead), lead_to(ahead, roll, normal, (1.0, 0.0))
    risen = size / params.raise_rate + params.raise_stop / 2.0
    swing = math.copysign(size, angle_between(normal, seen.axis) - params.tilt)
    return Raised(normal, about, axis, roll, lead, along, swing, risen, risen + params.settle)


def left_to_raise(params: CornerInsertParams, raised: Raised, elapsed: float) -> float:
    """Return the angle that the setpoint is still to be raised by after `elapsed` seconds, rad: at a constant rate, which fades to nothing
    within the time of the stop. It is negative where the peg leans by less than it shall, and has to be lowered.
    """
    left = max(raised.risen - elapsed, 0.0)
    if left >= params.raise_stop:
        size = params.raise_rate * (left - params.raise_stop / 2.0)
    else:
        size = params.raise_rate * left * left / (2.0 * params.raise_stop)
    return math.copysign(min(size, abs(raised.swing)), raised.swing)


def lead_at(params: CornerInsertParams, raised: Raised, elapsed: float) -> Vector:
    """Return the lead of the tip's setpoint before any yaw after `elapsed` seconds, shape (3,), m: while the peg is raised friction at
    a wall that is pressed harder would hold it, and the raised peg would climb out.
    """
    share = min(max(elapsed - raised.risen, 0.0) / max(params.settle, 1e-9), 1.0)
    more = max(params.press - float(raised.lead @ raised.along), 0.0)
    lead: Vector = raised.lead + share * more * raised.along
    return lead


def sweep_of(params: CornerInsertParams, most: float, attempt: int) -> YawSweep:
    """Return the yaw sweep of an attempt, counted from 0, for a hole that is turned by at most `most`, rad."""
    centre = params.centres[attempt % len(params.centres)] * most
    reach, bound = (max(angle, params.felt) + params.margin for angle in (params.yaw_sweep * most, most))
    return YawSweep(centre, reach, bound)


def attitude(params: CornerInsertParams, raised: Raised, sweep: YawSweep, elapsed: float, length: float) -> Vector:
    """Return the rotation, shape (3, 3), from the raised peg to its setpoint after `elapsed` seconds: raised as far as
    it is time for, yawed, dithered once the peg has settled.
    """
    yawed = rotation_about(raised.normal, sweep.yaw(elapsed, raised.settled, params))
    turned: Vector = yawed @ rotation_about(raised.about, left_to_raise(params, raised, elapsed))
    if elapsed < raised.settled:
        return turned
    offset = dither(elapsed - raised.settled, params.dither_radius, params.dither_rate, params.dither_period)
    return tipped(offset / length) @ turned


def _setpoint(
    params: CornerInsertParams,
    ctx: SkillContext,
    seen: Observation,
    raised: Raised,
    sweep: YawSweep,
    identity: int,
    theta: float,
) -> ImpedanceSetpoint:
    """Return the setpoint of one scan; `theta` is the in-hand angle that the hand has turned after so far, rad."""
    stiffness, length = params.gains.stiffness(), ctx.length
    stiffness[2] = params.push_stiffness * (1.0 if seen.elapsed >= raised.settled else params.push_back)
    now, soon = (attitude(params, raised, sweep, seen.elapsed + later, length) for later in (0.0, ctx.scan_period))
    yawed = rotation_about(raised.normal, sweep.yaw(seen.elapsed, raised.settled, params))
    left = rotation_about(seen.arm.tcp.rotation[:, 2], seen.peg.theta - theta)
    return ImpedanceSetpoint(
        id=identity,
        tip=seen.tip + yawed @ lead_at(params, raised, seen.elapsed) - params.push_offset * raised.normal,
        axis=left @ now @ raised.axis,
        roll=now @ raised.roll,
        stiffness=stiffness,
        damping_ratio=params.gains.damping_ratios(),
        valid_until=seen.stamp + VALIDITY,
        in_hand=ctx.in_hand(),
        integral_gain=params.integral_gain,
        integral_limit=params.integral_limit,
        twist=Twist(np.zeros(3), spin_between(now, soon, ctx.scan_period)),
    )


def lead_to(ahead: Vector, roll: Vector, normal: Vector, leads: tuple[float, float]) -> Vector:
    """Return the lead of the tip's setpoint, along the closing axis `roll` and across it to the side of `ahead`, in the
    plane, shape (3,), m.
    """
    along = roll - float(roll @ normal) * normal
    along /= float(np.linalg.norm(along))
    across = np.cross(normal, along)
    lead: Vector = math.copysign(leads[0], ahead @ along) * along + math.copysign(leads[1], ahead @ across) * across
    return lead


def tipped(offset: Vector) -> Vector:
    """Return the rotation, shape (3, 3), that tilts an upright body by `offset`, shape (2,), rad, towards x and y."""
    size = math.hypot(offset[0], offset[1])
    return rotation_about(np.array([-offset[1], offset[0], 0.0]) / size, size) if size > 1e-9 else np.eye(3)


def turned_by(now: Vector, before: Vector, normal: Vector) -> float:
    """Return the angle about `normal` from `before` to `now`, rad; all three are unit vectors of shape (3,)."""
    along = float(normal @ now) * float(normal @ before)
    return math.atan2(float(normal @ np.cross(before, now)), float(before @ now) - along)


def to_and_fro(time: float, rate: float, growth: float, reach: float) -> float:
    """Return the angle after `time` of turning at constant `rate` from 0 to one side, then to the other, and so on,
    rad.

    Every turn reaches further than the last by `growth`, up to `reach`.
    """
    way, end, side = rate * time, 0.0, 1.0
    while True:
        far = side * min(abs(end) + growth, reach)
        if way <= abs(far - end):
            return end + side * way
        way -= abs(far - end)
        end, side = far, -side
