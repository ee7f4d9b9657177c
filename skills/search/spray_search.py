"""Cover the area that contains the hole the way a spray gun does until the peg's edge falls in: [gibbons], Sec. IV."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

from drivers.frames import UP
from drivers.quantities import Vector
from skills.contract import Observation, Outcome, Reason, SkillContext, SkillResult
from skills.motion import Goal
from skills.pull_out import LONGEST, approach
from skills.search.belief import Belief
from skills.search.course import ANYWHERE, Course, make_course
from skills.search.feel import EdgeEvidence, excess_of
from skills.search.params import SpraySearchParams
from skills.search.surface import Plane, SurfaceEstimate
from skills.search.sweep import SearchSweep
from skills.search.tour import Left

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class SpraySearchResult(SkillResult):
    """Place of the hole, and what the search measured on the way."""

    tip: tuple[float, float, float]
    """End point of the peg when it fell in, m, base frame; x_h of [gibbons]."""
    start: tuple[float, float]
    """First point of the path, m, base frame."""
    rests: int
    """Number of times that contact evidence stopped the path."""
    plane: Plane | None
    """Estimate of the plate's surface; None if no hole was found."""
    edge: tuple[float, float] | None = None
    """Lowest point of the peg in the hole, m, base frame; None if no hole was found."""
    seated: tuple[float, float] | None = None
    """Middle of the hole in the plate's surface, measured by the peg seated after this search, m, base frame."""
    left: Left | None = None
    """Rest of the course, not searched yet; None if no hole was found."""
    excess: float = 0.0
    """Peg length minus the length stated in the job, m, measured by touch-downs."""
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Force that the arm reported in free air, subtracted from its later readings, N, base frame."""
    noise: float = 0.0
    """Standard deviation of a component of that force, N."""


def run(
    params: SpraySearchParams,
    ctx: SkillContext,
    belief: Belief = ANYWHERE,
    make_evidence: Callable[[SpraySearchParams, SurfaceEstimate, float], EdgeEvidence] = EdgeEvidence,
) -> SpraySearchResult:
    """Search the area, from a random corner or the likely place, until the peg's edge falls into the hole.

    Args:
        params: Parameters of the search.
        ctx: The skill's context.
        belief: Likely place of the hole, which is searched first, and the rest of the path of earlier attempts.
        make_evidence: Function that returns the detector of the edge.

    Returns:
        Place at which the tip fell in, or the reason why the search ended without a fall.
    """
    course = make_course(params, ctx.job, ctx.rng, _with_prior(belief, ctx), ctx.peg.is_length_known)
    start = (course.first[0], course.first[1])
    if (stuck := approach(_above(course), params.transfer, params.pull, ctx)) is not None:
        return SpraySearchResult(Outcome.FAILURE, Reason.NOT_SEATED, LONGEST, _point(stuck), start, 0, None)
    evidence = make_evidence(params, SurfaceEstimate(), ctx.schedule.period)
    sweep, spent = SearchSweep(params, ctx, course, evidence), 0.0
    found, spent = _slide(params, ctx, sweep, spent)
    while found is None and spent < params.timeout:
        lifted = ctx.devices.clock.now()
        if (stuck := approach(_above(sweep.begin_anew()), params.transfer, params.pull, ctx)) is not None:
            spent += ctx.devices.clock.now() - lifted
            return SpraySearchResult(Outcome.FAILURE, Reason.NOT_SEATED, spent, _point(stuck), start, sweep.rests, None)
        sweep.hold_anew()
        found, spent = _slide(params, ctx, sweep, spent + ctx.devices.clock.now() - lifted)
    if found is None:
        tip = ctx.observe().tip
        return SpraySearchResult(Outcome.FAILURE, Reason.NO_HOLE, params.timeout, _point(tip), start, sweep.rests, None)
    return SpraySearchResult(
        outcome=Outcome.SUCCESS,
        reason=Reason.NONE,
        elapsed=spent,
        tip=_point(found.tip),
        start=start,
        rests=sweep.rests,
        plane=_referenced(evidence.plane(found.tip), params, ctx, sweep),
        edge=sweep.edge,
        left=sweep.left,
        excess=ctx.peg.excess,
        offset=_point(ctx.wrench.zero.force),
        noise=ctx.wrench.zero.noise,
    )


def _slide(
    params: SpraySearchParams, ctx: SkillContext, sweep: SearchSweep, spent: float
) -> tuple[Observation | None, float]:
    """Slide the peg until it is in the hole, the time is over, or it must be lifted.

    Args:
        params: Parameters of the search.
        ctx: The skill's context.
        sweep: Motion of the peg.
        spent: Duration of the search so far, s.

    Returns:
        The scan in which the peg was judged to be in the hole, or None; and the duration of the search, s.
    """
    for seen in ctx.scan(params.timeout - spent, holding=True):
        if sweep.finds(seen):
            return seen, spent + seen.running
        if sweep.is_to_lift(seen):
            return None, spent + seen.running
        ctx.callbacks.progress(sweep.progress)
        ctx.follow(sweep.setpoint(seen))
    return None, params.timeout


def _above(course: Course) -> Goal:
    return Goal(course.first, course.axis, course.closing)


def _with_prior(belief: Belief, ctx: SkillContext) -> Belief:
    """Return the belief for a first attempt, with the prior of the job; later attempts have their own."""
    prior = ctx.job.hole.prior
    return belief if prior is None or belief.failed else replace(belief, likely=prior)


def _referenced(plane: Plane, params: SpraySearchParams, ctx: SkillContext, sweep: SearchSweep) -> Plane:
    """Return the plate's surface, corrected by the peg's slip along the fingers since its touch-down; the length takes the slip over.

    If the peg slips up into the hand, the estimated plate at the place of the touch-down seems to sink. A tilt of the plate has no such effect.
    """
    touched = sweep.touched
    if touched is None or not ctx.peg.is_length_known:
        return plane
    sunk = plane.depth(touched) / float(plane.normal[2])
    excess = excess_of(sunk, sweep.axis, params.length_bound, has_touched=True)
    if not excess:
        return plane
    logger.info("peg: slipped by %.1f mm along the fingers during the search", -1e3 * excess)
    ctx.note_touch(excess)
    return Plane(plane.point - excess * float(sweep.axis[2]) * UP, plane.normal)


def _point(tip: Vector) -> tuple[float, float, float]:
    return float(tip[0]), float(tip[1]), float(tip[2])
