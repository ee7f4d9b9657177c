"""Bring a peg with corners, one of which is in its hole, upright between the walls, so that the hole guides it.

At a small tilt the peg stands as deep as its corner reaches. On the way upright its corner stays led into the hole's own, which
keeps it in place along both walls, and its yaw sweeps to and fro about the one that the insertion found. How far the tip then
sinks tells that the peg is between the walls; from there on the hole guides it as it guides a round peg.
"""

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.frames import angle_between, end_point, rotation_about
from drivers.quantities import ImpedanceSetpoint, InHandTip, Twist, Vector
from skills.contract import Observation, Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.corner_insert import lead_to, to_and_fro, turned_by
from skills.motion import VALIDITY, Gains, tilted_by
from skills.paths import dither
from skills.seating import depth_of, is_seated
from skills.surface import Plane, nominal

TURNED = 0.2
"""Turn of the peg in the hand beyond which its tip does not move as the hand does, rad; several times the noise of theta."""

STRAYED_FOR = 0.15
"""Time for which the tip has to have strayed, s: some frames of the skin. Source: docs/tried/corners.md."""
SINKS = 0.25
"""Share of `caught` by which a peg that still goes in sinks within `STANDS_FOR`, fraction. Source: docs/tried/corners.md."""
STANDS_FOR = 0.8
"""Time after which a peg that the walls have caught stands, s; the next skill frees it, for it reads theta anew. Source: docs/tried/corners.md."""


class CornerAdjustParams(SkillParams):
    """How to bring a peg with corners between the walls of its hole. The skill uses no tactile measurements.

    Source: chosen, not measured; reason in docs/tried/corners.md.
    """

    gains: Gains
    """Stiffness and damping ratio along x and y and in rotation. Source: chosen within the margin that `cell check` prints."""
    push_stiffness: PositiveFloat
    """Stiffness along z, which makes the push, N/m."""
    push_damping_ratio: PositiveFloat
    """Damping along z, multiple of the critical one."""
    push_offset: NonNegativeFloat
    """Depth of the tip's setpoint below the tip, m."""
    lead: tuple[NonNegativeFloat, NonNegativeFloat]
    """Distance of the tip's setpoint ahead of the tip, along the closing axis and across it, m; it keeps the corner in the hole's own."""
    raise_rate: PositiveFloat
    """Rate at which the setpoint of the axis goes towards the normal, rad/s."""
    tilt: Annotated[float, Field(ge=0.0, lt=0.2)]
    """Tilt that is kept until the tip has sunk by `caught`, rad; upright before, the corner is no deeper than the others, and leaves the hole."""
    caught: PositiveFloat
    """Distance by which the tip sinks when the walls have the peg's sides, m."""
    strayed: PositiveFloat
    """Distance of the tip from where it began, in the plate, at which the corner has left the hole, m."""
    dither_radius: NonNegativeFloat
    """First radius of the dither of the finger centre, m; it fades within each period."""
    dither_rate: PositiveFloat
    """Turning rate of the dither, rad/s."""
    dither_period: PositiveFloat
    """Period of the dither, s; within it the radius fades to nothing."""
    turn: PositiveFloat
    """Most by which the hand's yaw is asked to differ from what it is, rad; times the stiffness it bounds the torque on the walls."""
    turn_rate: PositiveFloat
    """Rate of the yaw sweep's setpoint about the normal, rad/s."""
    growth: PositiveFloat
    """Angle by which every turn to one side reaches further than the last, rad."""
    reach: Annotated[float, Field(gt=0.0, le=0.4)]
    """Largest angle of the sweep to either side, rad; the play that a peg has at its insertion's tilt is less."""
    entered: PositiveFloat
    """Distance by which the tip sinks when the peg is between the walls, m; more than the peg slips along the fingers."""
    timeout: PositiveFloat
    """Longest time until the peg is between the walls, s; otherwise the cell searches anew and turns the peg another way."""


@dataclass(frozen=True, slots=True)
class CornerAdjustResult(SkillResult):
    """Where the peg was when the walls had it, or time was up."""

    depth: float
    """Depth of the tip below the surface by the arm, m."""


@dataclass(frozen=True, slots=True, eq=False)
class Entry:
    """How the peg began, and the setpoints that follow from it; pure."""

    params: CornerAdjustParams
    in_hand: InHandTip
    """The peg in the hand, frozen: an estimate that is fed back while the peg is wedged would follow its own bias."""
    normal: Vector
    """Normal of the plate, unit, shape (3,), base frame."""
    axis: Vector
    """Axis of the peg at the beginning, unit, shape (3,), base frame."""
    closing: Vector
    """Closing axis of the hand at the beginning, unit, shape (3,), base frame."""
    lean: Vector = field(init=False)
    """Direction in the plate that the peg leaned to, unit, shape (3,)."""
    lead: Vector = field(init=False)
    """Lead of the tip's setpoint before any yaw, shape (3,), m."""

    def __post_init__(self) -> None:
        """Derive the lean and the lead."""
        lean = self.axis - float(self.axis @ self.normal) * self.normal
        object.__setattr__(self, "lean", lean / max(float(np.linalg.norm(lean)), 1e-9))
        object.__setattr__(self, "lead", lead_to(self.lean, self.closing, self.normal, self.params.lead))

    def end_point(self, seen: Observation) -> tuple[Vector, Vector]:
        """Return end point, m, and axis of the peg, each shape (3,), base frame."""
        return end_point(seen.arm.tcp, self.in_hand.theta, self.in_hand.length)

    def axis_at(self, left: float, elapsed: float) -> Vector:
        """Return the setpoint of the axis, unit, shape (3,), where a tilt of `left`, rad, is left after `elapsed` seconds of the dither."""
        params, length = self.params, self.in_hand.length
        offset = dither(elapsed, params.dither_radius, params.dither_rate, params.dither_period)
        return tilted_by(offset + length * (self.normal[:2] + math.sin(left) * self.lean[:2]), length)

    def raised(self, left: float, sunk: float, period: float) -> float:
        """Return the tilt that is left of `left`, rad, after `period` seconds more, where the tip has sunk by `sunk`, m."""
        least = 0.0 if sunk > self.params.caught else self.params.tilt
        return max(left - self.params.raise_rate * period, min(left, least))

    def setpoint(
        self, seen: Observation, tilts: tuple[float, float], period: float, identity: int
    ) -> ImpedanceSetpoint:
        """Return the setpoint of a scan; `tilts` are those of its setpoint now and a `period`, s, later, rad."""
        params, closing = self.params, seen.arm.tcp.rotation[:, 2]
        tip, axis = self.end_point(seen)
        yaw = turned_by(closing, self.closing, self.normal)
        asked = to_and_fro(seen.elapsed, params.turn_rate, params.growth, params.reach) - yaw
        stiffness, damping_ratio = params.gains.stiffness(), params.gains.damping_ratios()
        stiffness[2], damping_ratio[2] = params.push_stiffness, params.push_damping_ratio
        target = tip + rotation_about(self.normal, yaw) @ self.lead
        target[2] -= params.push_offset
        now, soon = (self.axis_at(left, seen.elapsed + later) for left, later in zip(tilts, (0.0, period), strict=True))
        return ImpedanceSetpoint(
            id=identity,
            tip=target,
            axis=now,
            roll=rotation_about(axis, min(max(asked, -params.turn), params.turn)) @ closing,
            stiffness=stiffness,
            damping_ratio=damping_ratio,
            valid_until=seen.stamp + VALIDITY,
            in_hand=self.in_hand,
            twist=Twist(np.zeros(3), np.cross(now, soon) / period),
        )


@dataclass(frozen=True, slots=True)
class Watch:
    """Whether the corner is still in the hole, and whether the peg has been caught by the walls and stands; pure."""

    deepest: float = 0.0
    """Distance that the tip had sunk when it last counted as going in, m."""
    since: float = 0.0
    """Time of that, s."""
    inside: float = 0.0
    """Time at which the tip was last where it may be, s."""

    def after(self, elapsed: float, sunk: float, strayed: float, params: CornerAdjustParams) -> "Watch":
        """Return the watch after a scan in which the tip has sunk by `sunk`, m, and lies `strayed`, m, from where it began in the plate; a peg that
        the walls have caught cannot stray.
        """
        inside = elapsed if strayed <= params.strayed or sunk > params.caught else self.inside
        if sunk > self.deepest + SINKS * params.caught:
            return Watch(sunk, elapsed, inside)
        return Watch(self.deepest, self.since, inside)

    def has_strayed(self, elapsed: float) -> bool:
        """Return whether the tip has strayed for longer than the skin takes to tell a turn in the hand."""
        return elapsed - self.inside > STRAYED_FOR

    def is_caught(self, elapsed: float, params: CornerAdjustParams) -> bool:
        """Return whether the walls have caught the peg, and it stands."""
        return self.deepest > params.caught and elapsed - self.since > STANDS_FOR


def run(params: CornerAdjustParams, ctx: SkillContext, plane: Plane | None = None) -> CornerAdjustResult:
    """Bring the peg upright and turn it until it sinks between the walls; `plane` is the surface that the search
    estimated, None the job's own.
    """
    plane, hole = plane or nominal(ctx.job.hole), ctx.job.hole
    first, identity = ctx.observe(), ctx.new_id()
    entry = Entry(params, ctx.in_hand(), plane.normal, first.axis, first.arm.tcp.rotation[:, 2])
    tip, running, left = first.tip, 0.0, angle_between(first.axis, plane.normal)
    watch = Watch()
    for seen in ctx.scan(params.timeout, holding=True):
        running = seen.running
        tip, _ = entry.end_point(seen)
        sunk = plane.depth(tip) - plane.depth(first.tip)
        # A peg that turns in the hand moves the one for good, and the other until the next frame of the skin.
        strayed = min(math.dist(place[:2], first.tip[:2]) for place in (tip, seen.tip))
        watch = watch.after(seen.elapsed, sunk, strayed, params)
        if abs(seen.peg.theta - entry.in_hand.theta) > TURNED or watch.has_strayed(seen.elapsed):
            break
        is_between = sunk > params.entered or watch.is_caught(seen.elapsed, params)
        if is_seated(seen.switch, tip, hole) or is_between:
            return CornerAdjustResult(Outcome.SUCCESS, Reason.NONE, running, depth_of(tip, hole))
        ctx.progress(seen.elapsed / params.timeout)
        before, left = left, entry.raised(left, sunk, seen.step)
        ctx.follow(entry.setpoint(seen, (before, left), ctx.scan_period, identity))
    return CornerAdjustResult(Outcome.FAILURE, Reason.NOT_SEATED, running, depth_of(tip, hole))
