"""Raise a peg with corners, one corner in a hole of unknown yaw, and turn the peg until it drops in.

The skill raises the peg over its leading corner to a small tilt. There the peg rests at the depth of its corner. If the
peg's yaw matches the hole's to within the clearance, the peg sinks until its faces meet the walls. The hand sweeps the yaw
about the plate's normal and pushes the corner towards the hole's corner until the tip sinks or the walls hold the peg.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.config_model import Figure, Quantity, Source, Tempo
from drivers.frames import angle_between, rotation_about
from drivers.quantities import ImpedanceSetpoint, Twist, Vector
from skills.contract import Observation, Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.motion import VALIDITY, Gains, spin_between
from skills.paths import dither
from skills.search.surface import Plane, nominal
from skills.seating.decision import is_seated


class CornerInsertParams(SkillParams):
    """Parameters of raising and turning the peg."""

    SOURCE: ClassVar[str] = "chosen, not measured; reason in docs/tried/corners.md"

    gains: Annotated[Gains, Source("chosen within the margin that `cell check` prints")]
    """Stiffness and damping ratio along x and y and in rotation."""
    push_stiffness: Annotated[PositiveFloat, Quantity("N/m")]
    """Stiffness of the push along z, N/m."""
    push_back: Annotated[float, Field(gt=0.0, le=1.0), Quantity("fraction"), Source("docs/tried/corners.md")]
    """Share of the push while the peg is raised, fraction. Under the full push, the peg turns in the hand. Under too small a push,
    the lead lifts the corner over the edge.
    """
    push_offset: Annotated[float, Figure("m"), Field(exclude=True)] = 0.01
    """Depth of the tip's setpoint below the tip, m."""
    lead: Annotated[tuple[NonNegativeFloat, NonNegativeFloat], Quantity("m")]
    """Lead of the tip's setpoint over the tip, along the closing axis and across it, m; it keeps the corner in the
    hole's corner. A push across the closing axis turns the peg in the hand.
    """
    tilt: Annotated[float, Field(gt=0.0, lt=0.4), Quantity("rad"), Source("docs/tried/corners.md")]
    """Tilt to which the peg is raised, rad."""
    follow_rate: Annotated[float, Figure("1/s"), Field(exclude=True), Source("docs/tried/search.md")] = 2.0
    """Rate at which the hand follows a rotation of the peg between the pads, 1/s. If walls held the tip and the hand followed at once, the
    peg would only turn further between the pads.
    """
    integral_gain: Annotated[float, Figure("N·m/(rad·s)"), Field(exclude=True), Source("[gibbons], Eq. (6)")] = 5.0
    """Integral gain on orientation, N·m/(rad·s); K_I of [gibbons], Eq. (6)."""
    integral_limit: Annotated[float, Figure("N·m"), Field(exclude=True)] = 3.0
    """Saturation of the integral, N·m."""
    settle: Annotated[NonNegativeFloat, Quantity("s", Tempo.WAIT)]
    """Time to settle after the setpoint is raised, s."""
    raise_rate: Annotated[PositiveFloat, Quantity("rad/s", Tempo.SPEED)]
    """Rate at which the setpoint of the axis is raised, rad/s."""
    raise_stop: Annotated[NonNegativeFloat, Quantity("s", Tempo.WAIT), Source("docs/tried/corners.md")] = 0.3
    """Stopping time of the setpoint of the raised axis, s; if it stops at once, the hand's inertia moves the corner back along the
    closing axis by 2 mm.
    """
    press: Annotated[NonNegativeFloat, Quantity("m"), Source("docs/tried/corners.md")] = 0.003
    """Lead of the tip's setpoint over the tip along the closing axis once the peg is raised, m; it must overcome the friction of joints and
    plate. Because the pads are perpendicular to the closing axis, it does not turn the peg in the hand.
    """
    turn_rate: Annotated[PositiveFloat, Quantity("rad/s", Tempo.SPEED)]
    """Rate of the yaw sweep's setpoint about the normal, rad/s; slow enough for the peg to sink while its yaw matches
    the hole's.
    """
    centres: Annotated[tuple[Annotated[float, Field(ge=-1.0, le=1.0)], ...], Field(min_length=1), Quantity("fraction")]
    """Middle of the yaw sweep in each successive attempt, fraction of the hole's largest yaw. If a sweep went far beyond
    the hole's yaw, the corner would climb out of the hole.
    """
    centre: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.0
    """Middle of the yaw sweep in this attempt, fraction of the hole's largest yaw."""
    yaw_sweep: Annotated[float, Field(ge=0.0, le=1.0), Quantity("fraction")]
    """Reach of the yaw sweep to either side, fraction of the hole's largest yaw; at least `felt` is used, because the lag of
    the hand cannot detect a wall within a smaller sweep.
    """
    margin: Annotated[NonNegativeFloat, Quantity("rad")]
    """Addition to the reach of the yaw sweep, rad."""
    dither_radius: Annotated[NonNegativeFloat, Quantity("m")]
    """Largest radius of the dither of the finger centre, m; it fades within each period and releases static friction
    of the peg.
    """
    dither_rate: Annotated[float, Figure("rad/s", Tempo.SPEED, "dither_radius"), Field(exclude=True)] = 25.0
    """Turning rate of the dither, rad/s."""
    dither_period: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True)] = 0.5
    """Period of the dither, s; the radius fades to zero within it."""
    growth: Annotated[PositiveFloat, Quantity("rad")]
    """Increase of the yaw sweep's amplitude from one swing to the next, rad; the likeliest yaws, near the middle of the
    sweep, are tried first.
    """
    felt: Annotated[PositiveFloat, Quantity("rad"), Source("docs/tried/corners.md")]
    """Lag of the hand behind its yaw setpoint above which walls hold the peg, rad; many times the lag caused by the joints'
    friction.
    """
    sunk: Annotated[PositiveFloat, Quantity("m")]
    """Least depth gained since the highest position in the sweep by a peg that has dropped in, even if no wall holds it, m."""
    strayed: Annotated[PositiveFloat, Quantity("m")]
    """Largest distance from its position at the start of the sweep at which the tip is still in the hole, m."""
    lost_height: Annotated[PositiveFloat, Quantity("m")]
    """Largest height above the surface at which the corner is still in the hole, m."""
    timeout: Annotated[PositiveFloat, Quantity("s", Tempo.LIMIT)]
    """Longest insertion, s."""


@dataclass(frozen=True, slots=True)
class CornerInsertResult(SkillResult):
    """Yaw and tilt of the peg at the end."""

    yaw: float
    """Yaw setpoint about the plate's normal relative to the start, rad."""
    phi: float
    """Angle between the peg and the plate's normal, with theta measured by the skin, rad."""


@dataclass(frozen=True, slots=True, eq=False)
class Raised:
    """Attitude of the raised peg before its yaw is swept."""

    normal: Vector
    """Normal of the plate, unit, shape (3,), base frame."""
    about: Vector
    """Axis of rotation for raising the peg, unit, shape (3,), base frame."""
    axis: Vector
    """Axis of the raised peg, unit, shape (3,), base frame."""
    roll: Vector
    """Closing axis of the hand with the peg raised, unit, shape (3,), base frame."""
    lead: Vector
    """Lead of the tip's setpoint at zero yaw, shape (3,), m, base frame."""
    along: Vector
    """Direction along the closing axis to the hole's corner at zero yaw, parallel to the plate, unit, shape (3,), base frame."""
    swing: float
    """Angle by which the peg is raised, rad; negative if it must be lowered to the tilt of the parameters."""
    risen: float
    """Time at which the setpoint has reached the raised attitude, s."""
    settled: float
    """Time at which the raised peg has settled and the yaw sweep starts, s."""


@dataclass(frozen=True, slots=True, eq=False)
class YawSweep:
    """Yaw sweep of one attempt, with the start and the largest height of the tip during the sweep."""

    centre: float
    """Middle of the sweep, rad."""
    reach: float
    """Largest angle to either side of the middle, rad."""
    most: float = math.inf
    """Largest magnitude of the yaw setpoint, rad: the largest yaw of a hole, at least `felt`, plus `margin`."""
    anchor: Vector | None = None
    """Position of the tip at the start of the sweep, shape (3,), m, base frame; None before the sweep."""
    highest: float = -math.inf
    """Largest height of the tip above the surface during the sweep, m."""

    def after(self, tip: Vector, depth: float) -> "YawSweep":
        """Return the sweep after a scan with the tip at `depth`, m, below the surface."""
        anchor = tip if self.anchor is None else self.anchor
        return replace(self, anchor=anchor, highest=max(self.highest, -depth))

    def distance(self, tip: Vector) -> float:
        """Return the distance of the tip from its position at the start of the sweep, m; 0 before the sweep."""
        return 0.0 if self.anchor is None else float(np.linalg.norm(tip - self.anchor))

    def yaw(self, elapsed: float, settled: float, params: CornerInsertParams) -> float:
        """Return the yaw setpoint, rad; until the peg has settled, it moves linearly to the middle of the sweep."""
        if elapsed < settled:
            return self.centre * min(elapsed / settled, 1.0)
        yaw = self.centre + to_and_fro(elapsed - settled, params.turn_rate, params.growth, self.reach)
        return min(max(yaw, -self.most), self.most)


def run(params: CornerInsertParams, ctx: SkillContext, plane: Plane | None = None) -> CornerInsertResult:
    """Sweep the yaw until it matches the hole's and the peg drops in.

    Args:
        params: Parameters of the skill.
        ctx: The skill's context.
        plane: Surface estimate of the search; None for the surface of the job.
    """
    plane = plane or nominal(ctx.job.hole)
    raised = raise_from(ctx.observe(), plane.normal, params)
    sweep = sweep_of(params, ctx.job.hole.yaw)
    identity = ctx.new_id()
    yaw, phi, theta = 0.0, params.tilt, ctx.in_hand().theta
    for seen in ctx.scan(params.timeout, holding=True):
        phi, elapsed = angle_between(seen.axis, plane.normal), seen.elapsed
        if is_seated(seen.switch, plane.depth(seen.tip), ctx.job.hole):
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
        ctx.callbacks.progress(elapsed / params.timeout)
        theta += min(params.follow_rate * seen.step, 1.0) * (seen.peg.theta - theta)
        ctx.follow(_setpoint(params, ctx, seen, raised, sweep, identity, theta))
    return CornerInsertResult(Outcome.FAILURE, Reason.NOT_ALIGNED, params.timeout, yaw, phi)


def raise_from(seen: Observation, normal: Vector, params: CornerInsertParams) -> Raised:
    """Return the attitude of the raised peg, from its present attitude, rotated over its leading corner."""
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
    """Return the remaining angle of the raise after `elapsed` seconds, rad; negative if the peg must be lowered.

    The rate of the raise is constant at first, and falls linearly to zero within the stopping time `raise_stop`.
    """
    # t = time left, w = raise_rate, s = raise_stop: w (t - s/2) for t >= s, else w t² / (2 s)
    left = max(raised.risen - elapsed, 0.0)
    if left >= params.raise_stop:
        size = params.raise_rate * (left - params.raise_stop / 2.0)
    else:
        size = params.raise_rate * left * left / (2.0 * params.raise_stop)
    return math.copysign(min(size, abs(raised.swing)), raised.swing)


def lead_at(params: CornerInsertParams, raised: Raised, elapsed: float) -> Vector:
    """Return the lead of the tip's setpoint at zero yaw after `elapsed` seconds, shape (3,), m, base frame.

    The lead grows to `press` only after the peg is raised. If the corner pressed harder against a wall earlier, friction
    would hold it and the peg would climb out while it is raised.
    """
    share = min(max(elapsed - raised.risen, 0.0) / max(params.settle, 1e-9), 1.0)
    more = max(params.press - float(raised.lead @ raised.along), 0.0)
    lead: Vector = raised.lead + share * more * raised.along
    return lead


def sweep_of(params: CornerInsertParams, most: float) -> YawSweep:
    """Return the yaw sweep for a hole with a yaw of at most `most`, rad."""
    reach, bound = (max(angle, params.felt) + params.margin for angle in (params.yaw_sweep * most, most))
    return YawSweep(params.centre * most, reach, bound)


def attitude(params: CornerInsertParams, raised: Raised, sweep: YawSweep, elapsed: float, length: float) -> Vector:
    """Return the rotation, shape (3, 3), from the raised attitude of the peg to its setpoint after `elapsed` seconds.

    The rotation combines the remaining raise, the yaw and, once the peg has settled, the dither.
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
    """Return the setpoint of one scan; `theta` is the in-hand angle that the hand has followed so far, rad."""
    stiffness, length = params.gains.stiffness(), ctx.length
    stiffness[2] = params.push_stiffness * (1.0 if seen.elapsed >= raised.settled else params.push_back)
    now, soon = (attitude(params, raised, sweep, seen.elapsed + later, length) for later in (0.0, ctx.schedule.period))
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
        twist=Twist(np.zeros(3), spin_between(now, soon, ctx.schedule.period)),
    )


def lead_to(ahead: Vector, roll: Vector, normal: Vector, leads: tuple[float, float]) -> Vector:
    """Return the lead of the tip's setpoint in the plane, shape (3,), m, on the side of `ahead`.

    Args:
        ahead: Direction that selects the signs of both leads, shape (3,).
        roll: Closing axis, unit, shape (3,).
        normal: Normal of the plane, unit, shape (3,).
        leads: Lead along the closing axis and across it, m.
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
    # atan2(n·(b × a), b·a - (n·a)(n·b)), a = now, b = before
    along = float(normal @ now) * float(normal @ before)
    return math.atan2(float(normal @ np.cross(before, now)), float(before @ now) - along)


def to_and_fro(time: float, rate: float, growth: float, reach: float) -> float:
    """Return the angle of a triangular sweep at constant `rate` about 0 after `time`, rad.

    The sweep alternates between both sides. The amplitude grows by `growth` from one swing to the next, up to `reach`.
    """
    way, end, side = rate * time, 0.0, 1.0
    while True:
        far = side * min(abs(end) + growth, reach)
        if way <= abs(far - end):
            return end + side * way
        way -= abs(far - end)
        end, side = far, -side
