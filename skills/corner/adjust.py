"""Bring a peg with corners upright between the walls of its hole, so that the hole guides it.

At the start, the peg leans a little, with one corner in the hole. The skill raises the peg and pushes this corner into
the hole's corner, which holds it at two walls. Meanwhile it sweeps the yaw about the yaw found by the insertion. The
depth gained by the tip shows when the peg is between the walls. From then on, the hole guides it like a round peg.
"""

import math
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.config_model import Figure, Quantity, Source, Tempo
from drivers.frames import angle_between, end_point, rotation_about
from drivers.quantities import ImpedanceSetpoint, InHandTip, Twist, Vector
from skills.contract import Observation, Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.corner.insert import lead_to, to_and_fro, turned_by
from skills.insert.guided_peg import Stall
from skills.motion import VALIDITY, Gains, tilted_by
from skills.paths import dither
from skills.search.surface import Plane, nominal
from skills.seating.decision import is_seated

STRAYED_FOR = 0.15
"""Time of the tip beyond `strayed` after which the corner is out of the hole, s: a few frames of the skin. Source: docs/tried/corners.md."""


class CornerAdjustParams(SkillParams):
    """Parameters of bringing a peg with corners between the walls of its hole.

    The setpoints use the theta measured at the start. Later theta serves only to detect a slip or a strayed tip.
    """

    SOURCE: ClassVar[str] = "chosen, not measured; reason in docs/tried/corners.md"

    gains: Annotated[Gains, Source("chosen within the margin that `cell check` prints")]
    """Stiffness and damping ratio along x and y and in rotation."""
    push_stiffness: Annotated[PositiveFloat, Quantity("N/m")]
    """Stiffness of the push along z, N/m."""
    push_damping_ratio: Annotated[float, Figure("multiple"), Field(exclude=True)] = 1.5
    """Damping ratio along z, multiple of the critical damping."""
    push_offset: Annotated[float, Figure("m"), Field(exclude=True)] = 0.01
    """Depth of the tip's setpoint below the tip, m."""
    lead: Annotated[tuple[NonNegativeFloat, NonNegativeFloat], Quantity("m")]
    """Lead of the tip's setpoint over the tip, along the closing axis and across it, m; it keeps the corner in the hole's corner."""
    raise_rate: Annotated[PositiveFloat, Quantity("rad/s", Tempo.SPEED)]
    """Rate at which the setpoint of the axis moves to the normal, rad/s."""
    tilt: Annotated[float, Field(ge=0.0, lt=0.2), Quantity("rad")]
    """Tilt to keep until the tip has sunk by `caught`, rad. If the peg were upright earlier, its corner would be no deeper than the other
    corners and would leave the hole.
    """
    caught: Annotated[PositiveFloat, Quantity("m")]
    """Depth gained at which the hole's walls guide the peg, m."""
    strayed: Annotated[PositiveFloat, Quantity("m")]
    """Largest distance of the tip from its start, parallel to the plate, at which the corner is still in the hole, m."""
    dither_radius: Annotated[NonNegativeFloat, Quantity("m")]
    """Largest radius of the dither of the finger centre, m; it fades within each period."""
    dither_rate: Annotated[float, Figure("rad/s", Tempo.SPEED, "dither_radius"), Field(exclude=True)] = 25.0
    """Turning rate of the dither, rad/s."""
    dither_period: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True)] = 0.5
    """Period of the dither, s; the radius fades to zero within it."""
    turn: Annotated[PositiveFloat, Quantity("rad")]
    """Largest difference between the setpoint and the measured yaw, rad; its product with the stiffness bounds the torque on the walls."""
    turn_rate: Annotated[PositiveFloat, Quantity("rad/s", Tempo.SPEED)]
    """Rate of the yaw sweep's setpoint about the normal, rad/s."""
    growth: Annotated[PositiveFloat, Quantity("rad")]
    """Increase of the yaw sweep's amplitude from one swing to the next, rad."""
    reach: Annotated[float, Field(gt=0.0, le=0.4), Quantity("rad")]
    """Largest angle of the sweep to either side, rad; it exceeds the play of the peg at the tilt of the insertion."""
    entered: Annotated[PositiveFloat, Quantity("m")]
    """Depth gained at which the peg is between the walls, m; it exceeds the slip along the fingers."""
    timeout: Annotated[PositiveFloat, Quantity("s", Tempo.LIMIT)]
    """Longest time until the peg is between the walls, s; if it passes, the cell searches again and sweeps about another yaw."""
    stands_for: Annotated[float, Figure("s", Tempo.WAIT), Field(exclude=True), Source("docs/tried/corners.md")] = 0.8
    """Time without depth gain after which a guided peg counts as stuck, s; the next skill frees it with a new theta."""
    sinks: Annotated[float, Figure("fraction"), Field(exclude=True), Source("docs/tried/corners.md")] = 0.25
    """Least depth gained within `stands_for`, fraction of `caught`; a peg that gains less is not sinking any more."""
    turned: Annotated[float, Figure("rad"), Field(exclude=True), Source("chosen, not measured")] = 0.2
    """Rotation of the peg in the hand above which the skill fails, rad; the tip then no longer follows the hand. Several times the noise of
    theta.
    """


@dataclass(frozen=True, slots=True)
class CornerAdjustResult(SkillResult):
    """Depth of the peg at the end."""

    depth: float
    """Depth of the tip below the surface, measured by the arm, m."""


@dataclass(frozen=True, slots=True, eq=False)
class Entry:
    """Initial state of the peg, and the setpoints computed from this state; pure."""

    params: CornerAdjustParams
    in_hand: InHandTip
    """Pose of the peg in the hand at the start. It is used throughout, because an updated estimate would drift with its bias while the peg is
    wedged.
    """
    normal: Vector
    """Normal of the plate, unit, shape (3,), base frame."""
    axis: Vector
    """Axis of the peg at the start, unit, shape (3,), base frame."""
    closing: Vector
    """Closing axis of the hand at the start, unit, shape (3,), base frame."""

    @property
    def lean(self) -> Vector:
        """Direction of the peg's lean, parallel to the plate, unit, shape (3,), base frame."""
        lean = self.axis - float(self.axis @ self.normal) * self.normal
        return lean / max(float(np.linalg.norm(lean)), 1e-9)

    @property
    def lead(self) -> Vector:
        """Lead of the tip's setpoint at zero yaw, shape (3,), m, base frame."""
        return lead_to(self.lean, self.closing, self.normal, self.params.lead)

    def end_point(self, seen: Observation) -> tuple[Vector, Vector]:
        """Return the end point, m, and the axis of the peg, each shape (3,), base frame."""
        return end_point(seen.arm.tcp, self.in_hand.theta, self.in_hand.length)

    def axis_at(self, left: float, elapsed: float) -> Vector:
        """Return the setpoint of the axis, unit, shape (3,), for the tilt `left`, rad, `elapsed` seconds into the dither."""
        params, length = self.params, self.in_hand.length
        offset = dither(elapsed, params.dither_radius, params.dither_rate, params.dither_period)
        return tilted_by(offset + length * (self.normal[:2] + math.sin(left) * self.lean[:2]), length)

    def raised(self, left: float, sunk: float, period: float) -> float:
        """Return the next tilt, rad.

        Args:
            left: Present tilt, rad.
            sunk: Depth gained by the tip, m.
            period: Time to the next tilt, s.
        """
        least = 0.0 if sunk > self.params.caught else self.params.tilt
        return max(left - self.params.raise_rate * period, min(left, least))

    def setpoint(
        self, seen: Observation, tilts: tuple[float, float], period: float, identity: int
    ) -> ImpedanceSetpoint:
        """Return the setpoint of a scan; `tilts` are the tilts of the setpoint now and `period` seconds later, rad."""
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
class EntryWatch:
    """Detects over the scans that the corner has left the hole, or that the walls guide the peg but it is stuck; pure."""

    stall: Stall = field(default_factory=lambda: Stall(0.0))
    """Depth gained at the last progress, and its time."""
    inside: float = 0.0
    """Last time at which the tip was within `strayed`, s."""

    def after(self, elapsed: float, sunk: float, strayed: float, params: CornerAdjustParams) -> "EntryWatch":
        """Return the state after one more scan; a peg that the walls guide counts as inside `strayed`.

        Args:
            elapsed: Time of the scan, s.
            sunk: Depth gained by the tip, m.
            strayed: Distance of the tip from its start, parallel to the plate, m.
            params: Limits of the skill.
        """
        inside = elapsed if strayed <= params.strayed or sunk > params.caught else self.inside
        return EntryWatch(self.stall.after(sunk, elapsed, params.sinks * params.caught), inside)

    def has_strayed(self, elapsed: float) -> bool:
        """Return True if the tip has strayed for longer than `STRAYED_FOR`, in which the skin measures a turn in the hand."""
        return elapsed - self.inside > STRAYED_FOR

    def is_caught(self, elapsed: float, params: CornerAdjustParams) -> bool:
        """Return True if the walls guide the peg and it is stuck."""
        return self.stall.deepest > params.caught and elapsed - self.stall.since > params.stands_for


def run(params: CornerAdjustParams, ctx: SkillContext, plane: Plane | None = None) -> CornerAdjustResult:
    """Bring the peg upright and turn it until it sinks between the walls.

    Args:
        params: Parameters of the skill.
        ctx: The skill's context.
        plane: Surface estimate of the search; None for the surface of the job.
    """
    plane, hole = plane or nominal(ctx.job.hole), ctx.job.hole
    first, identity = ctx.observe(), ctx.new_id()
    entry = Entry(params, ctx.in_hand(), plane.normal, first.axis, first.arm.tcp.rotation[:, 2])
    tip, running, left = first.tip, 0.0, angle_between(first.axis, plane.normal)
    watch = EntryWatch()
    for seen in ctx.scan(params.timeout, holding=True):
        running = seen.running
        tip, _ = entry.end_point(seen)
        sunk = plane.depth(tip) - plane.depth(first.tip)
        # If the peg turns in the hand, the tip with the frozen theta is wrong permanently, and the tip with the
        # measured theta is wrong until the next frame. The smaller distance is used.
        strayed = min(math.dist(place[:2], first.tip[:2]) for place in (tip, seen.tip))
        watch = watch.after(seen.elapsed, sunk, strayed, params)
        if abs(seen.peg.theta - entry.in_hand.theta) > params.turned or watch.has_strayed(seen.elapsed):
            break
        is_between = sunk > params.entered or watch.is_caught(seen.elapsed, params)
        if is_seated(seen.switch, plane.depth(tip), hole) or is_between:
            return CornerAdjustResult(Outcome.SUCCESS, Reason.NONE, running, plane.depth(tip))
        ctx.callbacks.progress(seen.elapsed / params.timeout)
        before, left = left, entry.raised(left, sunk, seen.step)
        ctx.follow(entry.setpoint(seen, (before, left), ctx.schedule.period, identity))
    return CornerAdjustResult(Outcome.FAILURE, Reason.NOT_SEATED, running, plane.depth(tip))
