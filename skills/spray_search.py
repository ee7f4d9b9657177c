"""Cover the area that contains the hole the way a spray gun does until the peg's edge falls in: [gibbons], Sec. IV."""

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.frames import UP
from drivers.quantities import ImpedanceSetpoint, Twist, Vector
from skills.contract import Observation, Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.corner import DIAGONAL, corner_ahead, lowest_corner
from skills.ground import Ground, Plane
from skills.motion import VALIDITY, Gains, Goal, Transfer, Trim, between, move, tilted
from skills.paths import Lanes, SprayPaint, lanes, spiral_at_speed, spray_paint
from skills.tactile.hole_event import HoleEvent, HoleEventParams

REST_DAMPING = 2.5
"""Damping of the resting hand over that of the search: it shall stop within a millimetre or two."""


DESCENT = 0.04
"""Speed at which the setpoint comes down to the surface, m/s: the blow grows with it."""
CROSSINGS = 18.5
"""Most diameters of the hole that a lane crosses in a second: what 0.15 m/s is for 8.1 mm, where no fall is missed."""
TOUCHED = 0.5
"""Share of the push by which the surface is felt, and for how long, s: a blow is no push."""
TOUCHED_TIME = 0.1
SLIP = 0.1
"""Change of theta that tells of a slip in the hand, rad."""
STRIDE = 2.0
"""Diameters of the hole that the peg has gone when, had it come down right into the hole, it has climbed out."""
CLIMBED_TIME = 0.2
"""In which the plate is then learnt anew before the tip goes back, s."""
RETURN_TIME = 0.4
"""In which the tip comes back to its path after a probe, s."""


class SpraySearchParams(SkillParams):
    """How to search."""

    transfer: Transfer
    """To the first point and down to the surface."""
    gains: Gains
    """Along the path."""
    push_stiffness: PositiveFloat
    """Along z, N/m."""
    relief: Annotated[float, Field(gt=0.0, le=1.0)]
    """The push is taken back to this share at every slip of the peg in the hand: friction at the tip turns it."""
    least_push: Annotated[float, Field(gt=0.0, le=1.0)]
    """But not below this share."""
    push_damping: PositiveFloat
    """Along z, N·s/m: the push over this is the fastest fall."""
    push_offset: NonNegativeFloat
    """The tip's setpoint lies so far below the surface, m; 0.01 in [gibbons]."""
    tilt: Annotated[float, Field(ge=0.0, lt=1.4)]
    """Of the peg, rad; 45 degrees in [gibbons]."""
    lean: Annotated[float, Field(ge=-math.pi, le=math.pi)]
    """Azimuth that the peg's upper end leans to, rad."""
    fast_axis: Literal["x", "y"]
    """Axis of the base frame that is swept fast."""
    path: Literal["sinusoids", "lanes"]
    """As [gibbons] has it, or straight lanes at one speed."""
    speed: Annotated[float, Field(gt=0.0, le=0.5)]
    """Peak speed of the tip, m/s."""
    run_up: NonNegativeFloat
    """Time in which the tip reaches its speed, s: sliding off at once digs the edge in."""
    pitch: Annotated[float, Field(gt=0.0, le=2.0)]
    """Largest distance between neighbouring passes, in diameters of the hole."""
    margin: Annotated[float, Field(ge=0.0, le=0.01)]
    """The path reaches so far beyond the area, m."""
    edge_leads: bool
    """The path is drawn by the lowest point of the peg's edge, which falls in, and not by the middle of its end."""
    height: Annotated[float, Field(gt=0.0, le=0.1)]
    """Above the surface at the end of the free-space approach, m."""
    touch_down: PositiveFloat
    """Longest time to come down to the surface, s; the path begins as soon as the push is felt."""
    trim_rate: NonNegativeFloat
    """At which the setpoint across the lanes is moved against the tip's error there, 1/s: joint friction holds the arm off."""
    trim_limit: NonNegativeFloat
    """Largest such move, m."""
    evidence: Literal["skin", "height"]
    """What stops the path: an event of the skin, as in [gibbons], or a dip of the tip, which no frame can miss."""
    event: HoleEventParams
    dip: PositiveFloat
    """Of the tip below the surface, that is evidence of an edge, m; the exact fall at 45 degrees is 2.4 mm."""
    fall: NonNegativeFloat
    """The resting tip must stand so far below the surface, m; 0 takes the evidence for the hole, as [gibbons] does."""
    rest: PositiveFloat
    """Time for which the hand rests before the tip's depth is judged, by a frame of its end, s."""
    probe_radius: NonNegativeFloat
    """Where the resting tip is not deep enough, a spiral of this radius looks round the place of the evidence, m."""
    probe_speed: PositiveFloat
    """Along that spiral, m/s."""
    probe_pitch: PositiveFloat
    """Between its turns, m."""
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
    rests: int
    """How often the path was stopped by evidence."""
    plane: Plane | None
    """The plate's surface as the tip felt it on the way; None where no hole was found."""


def run(
    params: SpraySearchParams, ctx: SkillContext, ground: Ground | None = None, event: HoleEvent | None = None
) -> SpraySearchResult:
    """Search from a random point of the area, with fresh watchers of plate and skin where none are given."""
    hole = ctx.job.hole
    surface = hole.centre[2]
    middle = np.array(hole.centre[:2])
    half = (hole.area[0] / 2 + params.margin, hole.area[1] / 2 + params.margin)
    start = ctx.rng.uniform(-np.array(hole.area) / 2, np.array(hole.area) / 2)
    fast = 0 if params.fast_axis == "x" else 1
    path: Lanes | SprayPaint
    if params.path == "lanes":
        path = lanes(
            half,
            params.pitch * hole.diameter,
            min(params.speed, CROSSINGS * hole.diameter),
            fast,
            (start[0], start[1]),
        )
    else:
        path = spray_paint(half, params.pitch * hole.diameter, params.speed, fast, (start[0], start[1]))
    peg, lean = ctx.job.peg, params.lean
    axis, closing = tilted(lean, params.tilt)
    ahead = peg.diameter / 2 * math.cos(params.tilt)
    if peg.shape == "square":
        axis, closing = corner_ahead(lean, params.tilt)
        ahead, lean = math.sqrt(2.0) * ahead, lean + DIAGONAL
    if params.edge_leads:
        middle = middle - ahead * np.array([math.cos(lean), math.sin(lean)])
    first = np.array([*(middle + start), surface + params.height])
    here = ctx.observe()
    if here.tip[2] < first[2]:
        # It may stand in the hole: out of it straight, before anything else.
        out = Goal(np.array([*here.tip[:2], first[2]]), here.axis, here.arm.tcp.rotation[:, 2])
        for _ in move(out, params.transfer, ctx, ctx.in_hand()):
            pass
    for _ in move(Goal(first, axis, closing), params.transfer, ctx, ctx.in_hand()):
        pass

    stiffness, damping = params.gains.stiffness(), params.gains.damping()
    stiffness[2], damping[2] = params.push_stiffness, params.push_damping
    identity = ctx.new_id()
    event, ground = event or HoleEvent(params.event, params.timeout), ground or Ground()
    tip, along, offset, since, rests = first, 0.0, np.zeros(2), 0.0, 0
    trim, slow = Trim(params.trim_rate, params.trim_limit), 1 - fast
    phase, place = Phase.COMING_DOWN, first
    landed: tuple[Vector, Vector] | None = None
    climbed = math.inf
    resting: ImpedanceSetpoint | None = None
    leaning, facing = axis, closing
    pressed = 0
    known_theta, push = ctx.in_hand().theta, params.push_stiffness
    depth = surface - params.push_offset
    for seen in ctx.scan(params.timeout, holding=True):
        tip, elapsed = seen.tip, seen.elapsed
        is_event = seen.is_new_frame and event.update(seen.frame)
        if abs(seen.peg.theta - known_theta) > SLIP:
            known_theta, push = seen.peg.theta, max(params.relief * push, params.least_push * params.push_stiffness)
            stiffness = np.array([*stiffness[:2], push, *stiffness[3:]])
        point, velocity = path.at(along)
        sense = -1 if velocity[fast] < 0.0 else 1
        edge = lowest_point(tip, seen.axis, peg.diameter / 2)
        if peg.shape == "square":
            edge = lowest_corner(tip, seen.axis, seen.arm.tcp.rotation[:, 2], peg.diameter)
        below = ground.below(edge, sense)
        if phase is Phase.COMING_DOWN:
            pressed = pressed + 1 if seen.arm.wrench.force[2] > TOUCHED * push * params.push_offset else 0
            if pressed * ctx.scan_period >= TOUCHED_TIME or elapsed >= params.touch_down:
                phase, since = Phase.SLIDING, seen.stamp
                landed = (tip, edge) if params.fall > 0.0 else None
                event.restart()
        elif phase is Phase.SLIDING:
            if landed is not None:
                has_climbed = edge[2] - landed[1][2] > params.fall
                if has_climbed:
                    # It came down right into the hole, and the ground was learnt there.
                    ground, below = Ground(), 0.0
                if math.dist(edge[:2], landed[1][:2]) > STRIDE * hole.diameter:
                    if has_climbed:
                        climbed, place = seen.stamp, landed[0]
                    landed = None
            if is_event if params.evidence == "skin" else below > params.dip:
                phase, since, place, rests = Phase.RESTING, seen.stamp, tip, rests + 1
                resting = _rest(seen, identity, stiffness, damping, params)
            else:
                ground.learn(edge, sense)
                if seen.stamp - climbed >= CLIMBED_TIME:
                    phase, since, climbed = Phase.PROBING, seen.stamp, math.inf
                    offset, leaning, facing = tip[:2] - place[:2], seen.axis, seen.arm.tcp.rotation[:, 2]
                    event.restart()
        elif phase is Phase.PROBING and below > params.fall:
            phase, since, resting = Phase.JUDGING, seen.stamp, _rest(seen, identity, stiffness, damping, params)
        if phase in (Phase.RESTING, Phase.JUDGING) and (params.fall == 0.0 or seen.peg.stamp >= since + params.rest):
            if below >= params.fall:
                return SpraySearchResult(
                    Outcome.SUCCESS,
                    Reason.NONE,
                    elapsed,
                    _point(tip),
                    (first[0], first[1]),
                    event.count,
                    rests,
                    ground.plane(tip),
                )
            is_looking = phase is Phase.RESTING and params.probe_radius > 0.0
            phase, since = Phase.PROBING if is_looking else Phase.SLIDING, seen.stamp
            event.restart()
            offset, leaning, facing = (
                tip[:2] - (place[:2] if is_looking else middle + point),
                seen.axis,
                seen.arm.tcp.rotation[:, 2],
            )
        if phase in (Phase.RESTING, Phase.JUDGING) and resting is not None:
            # The hand and not the tip is held, for the fall turns the peg in the hand and theta is as old as the
            # last frame.
            ctx.follow(replace(resting, valid_until=seen.stamp + VALIDITY))
            continue
        target = np.array([0.0, 0.0, depth])
        twist = np.zeros(3)
        back = max(1.0 - (seen.stamp - since) / RETURN_TIME, 0.0)
        if phase is Phase.PROBING:
            looked = spiral_at_speed(seen.stamp - since, params.probe_speed, params.probe_pitch)
            target[:2] = place[:2] + looked + back * offset
            if math.hypot(*looked) > params.probe_radius:
                phase, offset, since, back = Phase.SLIDING, target[:2] - middle - point, seen.stamp, 1.0
                if below > params.dip:
                    # Deep all over: no edge, but theta has jumped, say, and with it the height of the plane.
                    ground = Ground()
                event.restart()
                leaning, facing = axis, closing
        if phase is Phase.SLIDING:
            # Pushed less, the peg falls less far in the same time.
            pace = push / params.push_stiffness * min((seen.stamp - since) / max(params.run_up, 1e-6), 1.0)
            along += pace * ctx.scan_period
            target[:2], twist[:2] = middle + point + back * offset, pace * velocity
        elif phase is Phase.COMING_DOWN:
            share = min(elapsed * DESCENT / (first[2] - depth), 1.0)
            target[:2], target[2] = middle + point, first[2] + (depth - first[2]) * share
        trim = trim.after(target[slow] - tip[slow], ctx.scan_period)
        target[slow] += trim.value
        ctx.progress(elapsed / params.timeout)
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=target,
                axis=between(axis, leaning, back),
                roll=between(closing, facing, back),
                stiffness=stiffness,
                damping=damping,
                valid_until=seen.stamp + VALIDITY,
                in_hand=ctx.in_hand(),
                twist=Twist(twist, np.zeros(3)),
            )
        )
    return SpraySearchResult(
        Outcome.FAILURE, Reason.NO_HOLE, params.timeout, _point(tip), (first[0], first[1]), event.count, rests, None
    )


class Phase(Enum):
    """What the search is doing."""

    COMING_DOWN = "coming down"
    SLIDING = "sliding"
    RESTING = "resting"
    PROBING = "probing"
    JUDGING = "judging"


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


def lowest_point(tip: Vector, axis: Vector, radius: float) -> Vector:
    """Return the lowest point of the peg's edge, shape (3,), m; `tip` the middle of its end face, `axis` unit, upwards."""
    down = axis[2] * axis - UP
    size = math.sqrt(float(down @ down))
    return tip + (radius / size) * down if size > 1e-9 else tip


def _point(tip: Vector) -> tuple[float, float, float]:
    return float(tip[0]), float(tip[1]), float(tip[2])
