"""Cover the area that contains the hole the way a spray gun does until the peg's edge falls in: [gibbons], Sec. IV."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.quantities import ImpedanceSetpoint, Twist, Vector
from skills.contract import Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.motion import VALIDITY, Gains, Goal, Transfer, move, tilted
from skills.paths import SprayPaint, spray_paint
from skills.tactile.hole_event import HoleEvent, HoleEventParams


class SpraySearchParams(SkillParams):
    """How to search."""

    transfer: Transfer
    """To the first point and down to the surface."""
    gains: Gains
    """Along the path."""
    push_stiffness: PositiveFloat
    """Along z, N/m."""
    push_offset: NonNegativeFloat
    """The tip's setpoint lies so far below the surface, m; 0.01 in [gibbons]."""
    tilt: Annotated[float, Field(ge=0.0, lt=1.4)]
    """Of the peg, rad; 45 degrees in [gibbons]."""
    lean: Annotated[float, Field(ge=-math.pi, le=math.pi)]
    """Azimuth that the peg's upper end leans to, rad."""
    fast_axis: Literal["x", "y"]
    """Axis of the base frame that is swept fast."""
    speed: Annotated[float, Field(gt=0.0, le=0.5)]
    """Peak speed of the tip, m/s."""
    pitch: Annotated[float, Field(gt=0.0, le=2.0)]
    """Largest distance between neighbouring passes, in diameters of the hole."""
    margin: Annotated[float, Field(ge=0.0, le=0.01)]
    """The path reaches so far beyond the area, m."""
    height: Annotated[float, Field(gt=0.0, le=0.1)]
    """Above the surface at the end of the free-space approach, m."""
    touch_down: PositiveFloat
    """Time to come down to the surface and let the push settle, s."""
    event: HoleEventParams
    drop: NonNegativeFloat
    """An event counts only when the tip has come down by this much, m; 0 trusts the skin alone, as [gibbons] does."""
    timeout: PositiveFloat
    """Longest search, s; 100 in [gibbons]."""


@dataclass(frozen=True, slots=True)
class SpraySearchResult(SkillResult):
    """Where the hole is."""

    tip: tuple[float, float, float]
    """End point of the peg when the event was seen, m, base frame: x_h of [gibbons]."""
    start: tuple[float, float]
    """First point of the path, m, base frame."""
    events: int
    """Events of the skin, false ones included."""


def run(params: SpraySearchParams, ctx: SkillContext) -> SpraySearchResult:
    """Search from a random point of the area."""
    hole = ctx.job.hole
    surface = hole.centre[2]
    middle = np.array(hole.centre[:2])
    half = (hole.area[0] / 2 + params.margin, hole.area[1] / 2 + params.margin)
    start = ctx.rng.uniform(-np.array(hole.area) / 2, np.array(hole.area) / 2)
    path = spray_paint(
        half, params.pitch * hole.diameter, params.speed, 0 if params.fast_axis == "x" else 1, (start[0], start[1])
    )
    axis, closing = tilted(params.lean, params.tilt)
    first = np.array([*(middle + start), surface + params.height])
    for _ in move(Goal(first, axis, closing), params.transfer, ctx, ctx.in_hand()):
        pass

    started = ctx.clock.now()
    stiffness, damping = params.gains.stiffness(), params.gains.damping()
    stiffness[2] = params.push_stiffness
    identity = ctx.new_id()
    event, drop = HoleEvent(params.event), Drop(params.drop)
    tip = first
    for seen in ctx.scan(params.timeout, holding=True):
        tip = seen.tip
        elapsed = seen.stamp - started
        target, velocity = _setpoint(path, elapsed - params.touch_down, middle, surface - params.push_offset)
        if elapsed < params.touch_down:
            share = elapsed / params.touch_down
            target[2] = first[2] + (surface - params.push_offset - first[2]) * min(2.0 * share, 1.0)
        else:
            has_dropped = drop.update(tip[2])
            if seen.is_new_frame and event.update(seen.frame) and has_dropped:
                return SpraySearchResult(
                    Outcome.SUCCESS, Reason.NONE, elapsed, _point(tip), (first[0], first[1]), event.count
                )
        ctx.progress(elapsed / params.timeout)
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=target,
                axis=axis,
                roll=closing,
                stiffness=stiffness,
                damping=damping,
                valid_until=seen.stamp + VALIDITY,
                in_hand=ctx.in_hand(),
                twist=Twist(velocity, np.zeros(3)),
            )
        )
    return SpraySearchResult(
        Outcome.FAILURE, Reason.NO_HOLE, params.timeout, _point(tip), (first[0], first[1]), event.count
    )


def _setpoint(path: SprayPaint, time: float, middle: Vector, z: float) -> tuple[Vector, Vector]:
    """Return setpoint and velocity of the tip on the path, each shape (3,); at rest at the first point before time 0."""
    point, velocity = path.at(max(time, 0.0))
    if time < 0.0:
        velocity = np.zeros(2)
    return np.array([*(middle + point), z]), np.array([*velocity, 0.0])


def _point(tip: Vector) -> tuple[float, float, float]:
    return float(tip[0]), float(tip[1]), float(tip[2])


class Drop:
    """Whether the tip has come down from the height at which it slid."""

    def __init__(self, least: float, blend: float = 0.02) -> None:
        """Watch for a drop of `least`, m, from a running mean of weight `blend` a scan."""
        self._least, self._blend = least, blend
        self._height: float | None = None

    def update(self, height: float) -> bool:
        """Take the tip's height, m; return whether it is down now."""
        if self._height is None:
            self._height = height
        is_down = height <= self._height - self._least
        if not is_down or self._least == 0.0:
            self._height += self._blend * (height - self._height)
        return is_down
