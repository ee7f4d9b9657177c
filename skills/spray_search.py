"""Cover the area that contains the hole the way a spray gun does until the peg's edge falls in: [gibbons], Sec. IV."""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.quantities import ImpedanceSetpoint, Twist, Vector
from skills.contract import Observation, Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.motion import VALIDITY, Gains, Goal, Transfer, move, tilted
from skills.paths import SprayPaint, spray_paint
from skills.tactile.hole_event import HoleEvent, HoleEventParams

REST_DAMPING = 2.5
"""Damping of the resting hand over that of the search: it shall stop within a millimetre or two."""


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
    edge_leads: bool
    """The path is drawn by the lowest point of the peg's edge, which falls in, and not by the middle of its end."""
    height: Annotated[float, Field(gt=0.0, le=0.1)]
    """Above the surface at the end of the free-space approach, m."""
    touch_down: PositiveFloat
    """Time to come down to the surface and let the push settle, s."""
    event: HoleEventParams
    drop: NonNegativeFloat
    """The tip must have come down by this much, m; 0 trusts the skin's event alone, as [gibbons] does."""
    window: PositiveFloat
    """The skin's event and the drop may lie so far apart, s."""
    dwell: PositiveFloat
    """A drop that lasts so long, the path at rest, is a fall also when no frame of the skin caught it, s."""
    settle: NonNegativeFloat
    """x_h is taken from a frame so long after the fall, s; 0 takes the one that showed it."""
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
    if params.edge_leads:
        ahead = ctx.job.peg.diameter / 2 * math.cos(params.tilt)
        middle = middle - ahead * np.array([math.cos(params.lean), math.sin(params.lean)])
    first = np.array([*(middle + start), surface + params.height])
    for _ in move(Goal(first, axis, closing), params.transfer, ctx, ctx.in_hand()):
        pass

    stiffness, damping = params.gains.stiffness(), params.gains.damping()
    stiffness[2] = params.push_stiffness
    identity = ctx.new_id()
    event, fall = HoleEvent(params.event), Fall(params.drop, params.window, params.dwell)
    tip, along, found = first, 0.0, math.inf
    resting: ImpedanceSetpoint | None = None
    for seen in ctx.scan(params.timeout, holding=True):
        tip, elapsed = seen.tip, seen.elapsed
        is_event = seen.is_new_frame and event.update(seen.frame)
        if elapsed >= params.touch_down and fall.update(seen.stamp, tip[2], is_event):
            found = min(found, seen.stamp)
        if seen.peg.stamp >= found + params.settle and not fall.holds():
            # It came up again: an edge, not the hole.
            found = math.inf
        if seen.peg.stamp >= found + params.settle:
            return SpraySearchResult(
                Outcome.SUCCESS, Reason.NONE, elapsed, _point(tip), (first[0], first[1]), event.count
            )
        if fall.is_down or found < math.inf:
            # The hand rests while the peg is down: dragged on, the peg would come out again. The hand and not the
            # tip is held, for the fall turns the peg in the hand and theta is as old as the last frame.
            resting = resting or _rest(seen, identity, stiffness, damping, params)
            ctx.follow(replace(resting, valid_until=seen.stamp + VALIDITY))
            continue
        resting = None
        target, velocity = _setpoint(path, along, middle, surface - params.push_offset)
        if elapsed < params.touch_down:
            share = min(2.0 * elapsed / params.touch_down, 1.0)
            target[2] = first[2] + (surface - params.push_offset - first[2]) * share
            velocity = np.zeros(3)
        else:
            along += ctx.scan_period
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


def _rest(
    seen: Observation, identity: int, stiffness: Vector, damping: Vector, params: SpraySearchParams
) -> ImpedanceSetpoint:
    """Return the setpoint that holds the hand where it is, still pushing down."""
    tcp = seen.arm.tcp
    push = np.array([0.0, 0.0, params.push_offset])
    return ImpedanceSetpoint(
        id=identity,
        tip=tcp.position - push,
        axis=-tcp.rotation[:, 0],
        roll=tcp.rotation[:, 2],
        stiffness=stiffness,
        damping=REST_DAMPING * damping,
        valid_until=seen.stamp + VALIDITY,
    )


def _setpoint(path: SprayPaint, time: float, middle: Vector, z: float) -> tuple[Vector, Vector]:
    """Return setpoint and velocity of the tip on the path, each shape (3,)."""
    point, velocity = path.at(time)
    return np.array([*(middle + point), z]), np.array([*velocity, 0.0])


def _point(tip: Vector) -> tuple[float, float, float]:
    return float(tip[0]), float(tip[1]), float(tip[2])


@dataclass(slots=True)
class Fall:
    """Tells a fall into the hole from the skin's events and the tip's height; pure.

    The skin alone errs: a fall takes less than a frame, and noise looks like one. The tip's drop lasts, and does
    not depend on theta while the closing axis lies in the plane of the tilt. Both within `window` are a fall at
    once; a drop that lasts for `dwell` is one without the skin.
    """

    drop: float
    """Least drop, m; 0 believes every event of the skin."""
    window: float
    dwell: float
    blend: float = 0.02
    """Weight of a scan in the running mean of the height at which the tip slides."""
    is_down: bool = False
    """The tip is down now."""
    _height: float | None = None
    _since: float = 0.0
    _event: float = -math.inf

    def holds(self) -> bool:
        """Return whether the tip is still down, as far as drops are asked for."""
        return self.drop == 0.0 or self.is_down

    def update(self, stamp: float, height: float, is_event: bool) -> bool:
        """Take one scan; return whether the peg has fallen in.

        Args:
            stamp: Time, s.
            height: Of the tip, m.
            is_event: The skin showed an event in this scan.
        """
        if self.drop == 0.0:
            return is_event
        if is_event:
            self._event = stamp
        if self._height is None:
            self._height = height
        was_down, self.is_down = self.is_down, height <= self._height - self.drop
        if not self.is_down:
            self._height += self.blend * (height - self._height)
            return False
        if not was_down:
            self._since = stamp
        return abs(self._event - self._since) <= self.window or stamp - self._since >= self.dwell
