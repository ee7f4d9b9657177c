"""Keep the tip still and tilt the peg along a growing spiral, pushing, until it is seated: [gibbons], Sec. V.B."""

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.frames import end_point
from drivers.quantities import ImpedanceSetpoint, InHandTip, Pose, Vector
from skills.contract import Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.ground import Plane, nominal
from skills.motion import VALIDITY, Gains, tilted_by
from skills.paths import dither, spiral
from skills.seating import OPEN_TOLERANCE, depth_of, is_seated, require_short_of_bottom

ARRIVING = 3.0
"""Damping along z close to the bottom, over that before."""


class SpiralAdjustParams(SkillParams):
    """How to tilt the peg about its tip; the spiral is drawn by the finger centre. Tactile measurements are not used."""

    growth: PositiveFloat
    """Growth of the spiral's radius at the finger centre, m/s."""
    turn_rate: PositiveFloat
    """Turning rate of the spiral, rad/s."""
    radius: PositiveFloat
    """Largest radius of the spiral, m; `stall_timeout` may end the spiral before."""
    stall_timeout: Annotated[float, Field(gt=0.0, le=120.0)]
    """Stall timeout, s; a peg that has not gone deeper by `jammed` for so long is not in the hole, or will not go in
    so. Close to the bottom the timeout alone counts."""
    timeout: PositiveFloat
    """Longest adjustment, s; where the radius is largest sooner, the spiral starts again."""
    gains: Gains
    """Stiffness and damping along x and y and in rotation."""
    push_stiffness: PositiveFloat
    """Stiffness along z, which makes the push, N/m."""
    push_damping: PositiveFloat
    """Damping along z, N·s/m; the push over this is the speed at which the peg arrives at the bottom."""
    push_offset: NonNegativeFloat
    """Depth of the tip's setpoint below the tip, m."""
    guided_depth: PositiveFloat
    """Depth of the tip from which a growing spiral would only load its walls, m."""
    dither_radius: NonNegativeFloat
    """First radius of the circles that the finger centre draws from there on, m; they fade, because torque that
    friction holds jams."""
    dither_rate: PositiveFloat
    """Turning rate of the circles, rad/s."""
    dither_period: PositiveFloat
    """Time in which the circles fade, s."""
    jammed: NonNegativeFloat
    """Least progress of the tip in one period of the circles, m; below it the skin is asked again how the peg is held,
    and every other time the peg is aimed where it rests, so that no torque is left but that of the circles."""
    arrival: NonNegativeFloat
    """Distance from the bottom within which the peg is damped more, m, so that it arrives without a blow."""


@dataclass(frozen=True, slots=True)
class SpiralAdjustResult(SkillResult):
    """How far the peg was tilted when the adjustment ended."""

    radius: float
    """Last commanded radius at the finger centre, m."""
    depth: float
    """Of the tip below the surface by the arm, m."""


@dataclass(frozen=True, slots=True)
class Stall:
    """For how long the peg has not gone deeper; pure."""

    deepest: float = -math.inf
    """Depth that counts as reached, m."""
    since: float = 0.0
    """When it was reached, as time of running, s."""

    def after(self, depth: float, elapsed: float, least: float) -> "Stall":
        """Return the stall after a scan at `depth`, m; only `least` more than before, m, counts as deeper."""
        return Stall(depth, elapsed) if depth > self.deepest + least else self

    def measured_anew(self, depth: float, before: float) -> "Stall":
        """Return the stall where another theta makes the depth of the same tip `depth` instead of what it was `before`, m."""
        return replace(self, deepest=self.deepest + depth - before)


@dataclass(frozen=True, slots=True, eq=False)
class Aim:
    """How the peg is taken to lie in the hand, and along what it is pushed.

    The angle is frozen but where the peg jams: fed back at every frame it would chase its own bias.
    """

    in_hand: InHandTip
    direction: Vector
    """Axis of the peg about which the finger centre moves, unit, shape (3,), base frame."""
    is_by_plate: bool = True
    """The direction is the plate's normal, and not how the peg rests in the hole."""

    def tip(self, tcp: Pose) -> Vector:
        """Return the end point of the peg, shape (3,), m, base frame."""
        return end_point(tcp, self.in_hand.theta, self.in_hand.length)[0]

    def freed(self, in_hand: InHandTip, tcp: Pose, normal: Vector) -> "Aim":
        """Return the aim after a jam: as the skin now says that the peg is held, and every other time along where it rests.

        Where little of the plate was felt, the hole tells better than the plate how it stands.
        """
        _, resting = end_point(tcp, in_hand.theta, in_hand.length)
        return Aim(in_hand, resting, False) if self.is_by_plate else Aim(in_hand, normal, True)


@dataclass(frozen=True, slots=True)
class Guide:
    """Whether the hole guides the peg, and what it gained in each period of the dither since; pure."""

    began: float = math.inf
    """When the peg was first deep enough, as time of running, s."""
    periods: int = 0
    """Periods that are over."""
    reached: float = 0.0
    """Depth at the end of the last one, m."""
    is_jammed: bool = False
    """A period ended in this scan that gained too little."""

    @property
    def is_on(self) -> bool:
        """Whether the hole guides the peg."""
        return math.isfinite(self.began)

    def after(self, depth: float, elapsed: float, params: SpiralAdjustParams) -> "Guide":
        """Return the guide after a scan at `depth`, m, `elapsed` seconds after the adjustment began."""
        if not self.is_on and depth <= params.guided_depth:
            return self
        began = min(self.began, elapsed)
        if int((elapsed - began) / params.dither_period) <= self.periods:
            return Guide(began, self.periods, self.reached)
        return Guide(began, self.periods + 1, depth, is_jammed=depth - self.reached < params.jammed)

    def offset(self, elapsed: float, params: SpiralAdjustParams) -> Vector:
        """Return how far the finger centre stands off the line that the peg is aimed along, shape (2,), m."""
        if not self.is_on:
            return spiral(elapsed % (params.radius / params.growth), params.growth, params.turn_rate)
        return dither(elapsed - self.began, params.dither_radius, params.dither_rate, params.dither_period)


def run(params: SpiralAdjustParams, ctx: SkillContext, plane: Plane | None = None) -> SpiralAdjustResult:
    """Tilt the peg along a growing spiral about its tip until it is seated; `plane` as for the insertion."""
    hole, plane = ctx.job.hole, plane or nominal(ctx.job.hole)
    first = ctx.observe()
    aim, stall, guide = Aim(ctx.in_hand(), plane.normal), Stall(), Guide()
    identity, offset, tip, elapsed = ctx.new_id(), np.zeros(2), first.tip, 0.0
    for seen in ctx.scan(params.timeout, holding=True):
        elapsed, tip = seen.elapsed, aim.tip(seen.arm.tcp)
        if is_seated(seen.switch, tip, hole):
            return _result(Outcome.SUCCESS, Reason.NONE, elapsed, offset, depth_of(tip, hole))
        depth = plane.depth(tip)
        stall = stall.after(depth, elapsed, params.jammed)
        if elapsed - stall.since > params.stall_timeout and depth_of(tip, hole) < hole.depth - OPEN_TOLERANCE:
            break
        guide = guide.after(depth, elapsed, params)
        if guide.is_jammed:
            aim = aim.freed(ctx.in_hand(), seen.arm.tcp, plane.normal)
            tip = aim.tip(seen.arm.tcp)
            guide = replace(guide, reached=plane.depth(tip))
            stall = stall.measured_anew(guide.reached, depth)
        offset = guide.offset(elapsed, params)
        ctx.progress(elapsed / params.timeout)
        stiffness, damping = _compliance(params, depth_of(tip, hole) > hole.depth - params.arrival)
        target = (tip if guide.is_on else first.tip).copy()
        target[2] = tip[2] - params.push_offset
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=target,
                axis=tilted_by(offset + aim.in_hand.length * aim.direction[:2], aim.in_hand.length),
                roll=first.arm.tcp.rotation[:, 2],
                stiffness=stiffness,
                damping=damping,
                valid_until=seen.stamp + VALIDITY,
                in_hand=aim.in_hand,
            )
        )
    require_short_of_bottom(tip, hole)
    return _result(Outcome.FAILURE, Reason.NOT_SEATED, elapsed, offset, depth_of(tip, hole))


def _compliance(params: SpiralAdjustParams, is_arriving: bool) -> tuple[Vector, Vector]:
    """Return stiffness and damping, each shape (6,); close to the bottom the peg is damped more."""
    stiffness, damping = params.gains.stiffness(), params.gains.damping()
    stiffness[2] = params.push_stiffness
    damping[2] = ARRIVING * params.push_damping if is_arriving else params.push_damping
    return stiffness, damping


def _result(outcome: Outcome, reason: Reason, elapsed: float, offset: Vector, depth: float) -> SpiralAdjustResult:
    return SpiralAdjustResult(outcome, reason, elapsed, float(np.linalg.norm(offset)), depth)
