"""Cover the area that contains the hole the way a spray gun does until the peg's edge falls in: [gibbons], Sec. IV."""

from dataclasses import dataclass

from drivers.quantities import Vector
from skills.contract import Outcome, Reason, SkillContext, SkillResult
from skills.ground import Ground, Plane
from skills.motion import Goal, move
from skills.pull_out import LONGEST, pull_out
from skills.search.course import Course, make_course
from skills.search.feel import Evidence
from skills.search.params import SpraySearchParams
from skills.search.sweep import Sweep
from skills.tactile.hole_event import HoleEvent


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
    course = make_course(params, ctx.job, ctx.rng)
    start = (course.first[0], course.first[1])
    if (stuck := _approach(params, ctx, course)) is not None:
        return SpraySearchResult(Outcome.FAILURE, Reason.NOT_SEATED, LONGEST, _point(stuck), start, 0, 0, None)
    evidence = Evidence(params, ground or Ground(), event or HoleEvent(params.event, params.timeout))
    sweep, tip = Sweep(params, ctx, course, evidence), course.first
    for seen in ctx.scan(params.timeout, holding=True):
        tip = seen.tip
        if sweep.finds(seen):
            plane, elapsed = evidence.plane(tip), seen.elapsed
            return SpraySearchResult(
                Outcome.SUCCESS, Reason.NONE, elapsed, _point(tip), start, evidence.events, sweep.rests, plane
            )
        ctx.progress(seen.elapsed / params.timeout)
        ctx.follow(sweep.setpoint(seen))
    return SpraySearchResult(
        Outcome.FAILURE, Reason.NO_HOLE, params.timeout, _point(tip), start, evidence.events, sweep.rests, None
    )


def _approach(params: SpraySearchParams, ctx: SkillContext, course: Course) -> Vector | None:
    """Move above the first point; return where the tip is stuck if the peg, which may stand in the hole, does not come out."""
    if ctx.observe().tip[2] < course.first[2]:
        stuck = pull_out(course.first[2], params.transfer.gains, ctx)
        if stuck is not None:
            return stuck
    for _ in move(Goal(course.first, course.axis, course.closing), params.transfer, ctx, ctx.in_hand()):
        pass
    return None


def _point(tip: Vector) -> tuple[float, float, float]:
    return float(tip[0]), float(tip[1]), float(tip[2])
