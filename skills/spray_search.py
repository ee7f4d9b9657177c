"""Cover the area that contains the hole the way a spray gun does until the peg's edge falls in: [gibbons], Sec. IV."""

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from drivers.quantities import ImpedanceSetpoint, Twist, Vector
from skills.contract import Observation, Outcome, Reason, SkillContext, SkillParams, SkillResult
from skills.ground import Ground, Plane
from skills.motion import VALIDITY, Gains, Goal, Transfer, Trim, between, move
from skills.paths import Lanes, SprayPaint, lanes, spiral_at_speed, spray_paint
from skills.pull_out import LONGEST, pull_out
from skills.tactile.hole_event import HoleEvent, HoleEventParams

REST_DAMPING = 2.5
"""Damping of the resting hand over that of the search: it shall stop within a millimetre or two."""


CROSSINGS = 18.5
"""Most diameters of the hole, or shorter sides, that a lane crosses in a second: what 0.15 m/s is for 8.1 mm, where few falls are missed."""
TOUCHED = 0.5
"""Share of the push by which the surface is felt, and for how long, s: a blow is no push."""
TOUCHED_TIME = 0.1
SLIP = 0.1
"""Change of theta that tells of a slip in the hand, rad."""
OUTSIDE = (2e-3, 4e-3)
"""The peg comes down so far from the rim of a hole at the border of the area, drawn evenly between these, m."""
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
    """Largest distance between neighbouring passes, in diameters of the hole, or shorter sides."""
    margin: tuple[Annotated[float, Field(ge=0.0, le=0.01)], Annotated[float, Field(ge=0.0, le=0.01)]]
    """The strips that the passes cover reach so far beyond the area, along its fast axis and across it, m."""
    edge_leads: bool
    """The path is drawn by the lowest point of the peg's edge, which falls in, and not by the middle of its end."""
    height: Annotated[float, Field(gt=0.0, le=0.1)]
    """Above the surface at the end of the free-space approach, m."""
    descent: Annotated[float, Field(gt=0.0, le=0.5)]
    """Speed at which the setpoint comes down to the surface, m/s: the blow grows with it."""
    touch_down: Annotated[float, Field(gt=TOUCHED_TIME)]
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
    """Search from a random corner or point of the area, with fresh watchers of plate and skin where none are given.

    A ground that turns out to have been learnt in the wrong place is left for a fresh one.
    """
    course = _course(params, ctx)
    if (stuck := _approach(params, ctx, course)) is not None:
        start = (course.first[0], course.first[1])
        return SpraySearchResult(Outcome.FAILURE, Reason.NOT_SEATED, LONGEST, _point(stuck), start, 0, 0, None)
    sweep = _Sweep(params, ctx, course, ground or Ground(), event or HoleEvent(params.event, params.timeout))
    for seen in ctx.scan(params.timeout, holding=True):
        if sweep.finds(seen):
            return sweep.result(Outcome.SUCCESS, Reason.NONE, seen.elapsed)
        ctx.progress(seen.elapsed / params.timeout)
        ctx.follow(sweep.setpoint(seen))
    return sweep.result(Outcome.FAILURE, Reason.NO_HOLE, params.timeout)


@dataclass(frozen=True, slots=True, eq=False)
class _Course:
    """Where the tip shall go, and how the peg is held on the way."""

    path: Lanes | SprayPaint
    middle: Vector
    """Of the area, for the tip, shape (2,), m."""
    first: Vector
    """Above the path's first point, shape (3,), m."""
    axis: Vector
    closing: Vector
    fast: int
    """Axis of the base frame that is swept fast, 0 or 1."""


def _course(params: SpraySearchParams, ctx: SkillContext) -> _Course:
    """Return the way over the area: lanes from the corner next to a random point of it, sinusoids from that point."""
    hole, part = ctx.job.hole, ctx.job.peg.part
    fast, pitch = 0 if params.fast_axis == "x" else 1, params.pitch * hole.part.inscribed
    half = [extent / 2 + params.margin[0 if axis == fast else 1] for axis, extent in enumerate(hole.area)]
    start = ctx.rng.uniform(-np.array(hole.area) / 2, np.array(hole.area) / 2)
    over, begin = (half[0], half[1]), (start[0], start[1])
    path: Lanes | SprayPaint
    if params.path == "lanes":
        run_in = max(hole.part.reach + ctx.rng.uniform(*OUTSIDE) - params.margin[0], 0.0)
        path = lanes(over, pitch, min(params.speed, CROSSINGS * hole.part.inscribed), fast, begin, run_in)
    else:
        path = spray_paint(over, pitch, params.speed, fast, begin)
    axis, closing = part.leaning(params.lean, params.tilt)
    ahead, lean = part.reach * math.cos(params.tilt), part.azimuth(params.lean)
    middle = np.array(hole.centre[:2])
    if params.edge_leads:
        middle = middle - ahead * np.array([math.cos(lean), math.sin(lean)])
    first = np.array([*(middle + path.at(0.0)[0]), hole.centre[2] + params.height])
    return _Course(path, middle, first, axis, closing, fast)


def _approach(params: SpraySearchParams, ctx: SkillContext, course: _Course) -> Vector | None:
    """Move above the first point; return where the tip is stuck if the peg, which may stand in the hole, does not come out."""
    if ctx.observe().tip[2] < course.first[2]:
        stuck = pull_out(course.first[2], params.transfer.gains, ctx)
        if stuck is not None:
            return stuck
    for _ in move(Goal(course.first, course.axis, course.closing), params.transfer, ctx, ctx.in_hand()):
        pass
    return None


class Phase(Enum):
    """What the search is doing."""

    COMING_DOWN = "coming down"
    SLIDING = "sliding"
    RESTING = "resting"
    PROBING = "probing"
    JUDGING = "judging"


class _Sweep:
    """The peg on its way over the plate: what it is doing, and the setpoint for that. One a search."""

    def __init__(
        self, params: SpraySearchParams, ctx: SkillContext, course: _Course, ground: Ground, event: HoleEvent
    ) -> None:
        self._params, self._ctx, self._course, self._ground, self._event = params, ctx, course, ground, event
        self._identity = ctx.new_id()
        self._stiffness, self._damping = params.gains.stiffness(), params.gains.damping()
        self._stiffness[2], self._damping[2] = params.push_stiffness, params.push_damping
        self._push, self._known_theta = params.push_stiffness, ctx.in_hand().theta
        self._trim = Trim(params.trim_rate, params.trim_limit)
        # When the phase began, as time of running, and when the hand was last stopped, as a stamp: frames have those.
        self._phase, self._since, self._stopped = Phase.COMING_DOWN, 0.0, 0.0
        self._along, self._pressed, self._rests = 0.0, 0, 0
        self._point, self._velocity = course.path.at(0.0)
        self._tip, self._below = course.first, 0.0
        # The place of the evidence, and how the setpoint stands off its path, and leans, until it is back.
        self._place, self._offset = course.first, np.zeros(2)
        self._leaning, self._facing = course.axis, course.closing
        self._resting: ImpedanceSetpoint | None = None

    def finds(self, seen: Observation) -> bool:
        """Take one observation; return whether the tip was judged to be in the hole."""
        params = self._params
        self._tip = seen.tip
        is_event = seen.is_new_frame and self._event.update(seen.frame)
        self._relieve(seen)
        self._point, self._velocity = self._course.path.at(self._along)
        sense = -1 if self._velocity[self._course.fast] < 0.0 else 1
        edge = self._edge(seen)
        self._below = self._ground.below(edge, sense)
        if self._phase is Phase.COMING_DOWN:
            self._touch(seen)
        elif self._phase is Phase.SLIDING:
            self._slide(seen, edge, sense, is_event)
        elif self._phase is Phase.PROBING:
            if self._below > params.fall:
                self._rest(seen, Phase.JUDGING)
            elif math.hypot(*self._looked(seen)) > params.probe_radius:
                self._give_up(seen)
        is_resting = self._phase in (Phase.RESTING, Phase.JUDGING)
        if is_resting and (params.fall == 0.0 or seen.peg.stamp >= self._stopped + params.rest):
            if self._below >= params.fall:
                return True
            self._leave(seen)
        return False

    def setpoint(self, seen: Observation) -> ImpedanceSetpoint:
        """Return what the arm shall follow now, and go on along the path; once a scan, after `finds`."""
        params, course = self._params, self._course
        if self._phase in (Phase.RESTING, Phase.JUDGING) and self._resting is not None:
            # The hand and not the tip is held, for the fall turns the peg in the hand and theta is as old as the
            # last frame.
            return replace(self._resting, valid_until=seen.stamp + VALIDITY)
        depth = self._ctx.job.hole.centre[2] - params.push_offset
        target, twist = np.array([0.0, 0.0, depth]), np.zeros(3)
        back = self._back(seen)
        if self._phase is Phase.PROBING:
            target[:2] = self._place[:2] + self._looked(seen) + back * self._offset
        elif self._phase is Phase.SLIDING:
            # Pushed less, the peg falls less far in the same time.
            run_up = min((seen.elapsed - self._since) / max(params.run_up, 1e-6), 1.0)
            pace = self._push / params.push_stiffness * run_up
            self._along += pace * self._ctx.scan_period
            target[:2] = course.middle + self._point + back * self._offset
            twist[:2] = pace * self._velocity
        elif self._phase is Phase.COMING_DOWN:
            share = min(seen.elapsed * params.descent / (course.first[2] - depth), 1.0)
            target[:2], target[2] = course.middle + self._point, course.first[2] + (depth - course.first[2]) * share
        slow = 1 - course.fast
        self._trim = self._trim.after(target[slow] - seen.tip[slow], self._ctx.scan_period)
        target[slow] += self._trim.value
        return ImpedanceSetpoint(
            id=self._identity,
            tip=target,
            axis=between(course.axis, self._leaning, back),
            roll=between(course.closing, self._facing, back),
            stiffness=self._stiffness,
            damping=self._damping,
            valid_until=seen.stamp + VALIDITY,
            in_hand=self._ctx.in_hand(),
            twist=Twist(twist, np.zeros(3)),
        )

    def result(self, outcome: Outcome, reason: Reason, elapsed: float) -> SpraySearchResult:
        """Return how the search ended."""
        first = (self._course.first[0], self._course.first[1])
        plane = self._ground.plane(self._tip) if outcome is Outcome.SUCCESS else None
        return SpraySearchResult(
            outcome, reason, elapsed, _point(self._tip), first, self._event.count, self._rests, plane
        )

    def _edge(self, seen: Observation) -> Vector:
        """Return the point of the peg that falls in first, shape (3,), m."""
        return self._ctx.job.peg.part.lowest(seen.tip, seen.axis, seen.arm.tcp.rotation[:, 2])

    def _relieve(self, seen: Observation) -> None:
        """Push less after a slip in the hand."""
        params = self._params
        if abs(seen.peg.theta - self._known_theta) > SLIP:
            self._known_theta = seen.peg.theta
            self._push = max(params.relief * self._push, params.least_push * params.push_stiffness)
            self._stiffness = np.array([*self._stiffness[:2], self._push, *self._stiffness[3:]])

    def _touch(self, seen: Observation) -> None:
        """Begin the path once the push is felt."""
        is_pressed = seen.arm.wrench.force[2] > TOUCHED * self._push * self._params.push_offset
        self._pressed = self._pressed + 1 if is_pressed else 0
        if self._pressed * self._ctx.scan_period >= TOUCHED_TIME or seen.elapsed >= self._params.touch_down:
            self._phase, self._since = Phase.SLIDING, seen.elapsed
            self._event.restart()

    def _slide(self, seen: Observation, edge: Vector, sense: int, is_event: bool) -> None:
        """Stop at evidence, or learn the plate."""
        params = self._params
        if is_event if params.evidence == "skin" else self._below > params.dip:
            self._place, self._rests = seen.tip, self._rests + 1
            self._rest(seen, Phase.RESTING)
            return
        self._ground.learn(edge, sense)

    def _rest(self, seen: Observation, phase: Phase) -> None:
        """Hold the hand where it is, still pushing down."""
        tcp = seen.arm.tcp
        self._phase, self._since, self._stopped = phase, seen.elapsed, seen.stamp
        self._resting = ImpedanceSetpoint(
            id=self._identity,
            tip=tcp.position - np.array([0.0, 0.0, self._params.push_offset]),
            axis=-tcp.rotation[:, 0],
            roll=tcp.rotation[:, 2],
            stiffness=self._stiffness,
            damping=REST_DAMPING * self._damping,
            valid_until=seen.stamp + VALIDITY,
        )

    def _leave(self, seen: Observation) -> None:
        """Go on where the resting tip was not deep enough: look round the place once, then along the path."""
        if self._phase is Phase.RESTING and self._params.probe_radius > 0.0:
            self._stand_off(seen, Phase.PROBING, self._place[:2])
        else:
            self._stand_off(seen, Phase.SLIDING, self._course.middle + self._point)

    def _stand_off(self, seen: Observation, phase: Phase, goal: Vector) -> None:
        """Begin `phase` from where the tip is, on the way back to `goal`, shape (2,)."""
        self._phase, self._since = phase, seen.elapsed
        self._offset = seen.tip[:2] - goal
        self._leaning, self._facing = seen.axis, seen.arm.tcp.rotation[:, 2]
        self._event.restart()

    def _back(self, seen: Observation) -> float:
        """Return the share of the stand-off that is left, 1 to 0."""
        return max(1.0 - (seen.elapsed - self._since) / RETURN_TIME, 0.0)

    def _looked(self, seen: Observation) -> Vector:
        """Return where the probe is about the place of the evidence, shape (2,), m."""
        return spiral_at_speed(seen.elapsed - self._since, self._params.probe_speed, self._params.probe_pitch)

    def _give_up(self, seen: Observation) -> None:
        """Leave a place where no hole was found, back to the path from where the setpoint is."""
        probed = self._place[:2] + self._looked(seen) + self._back(seen) * self._offset
        self._phase, self._since = Phase.SLIDING, seen.elapsed
        self._offset = probed - self._course.middle - self._point
        if self._below > self._params.dip:
            # Deep all over: no edge, but theta has jumped, say, and with it the height of the plane.
            self._ground = Ground()
        self._event.restart()
        self._leaning, self._facing = self._course.axis, self._course.closing


def _point(tip: Vector) -> tuple[float, float, float]:
    return float(tip[0]), float(tip[1]), float(tip[2])
