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
    """Where the hole was found."""

    tip: tuple[float, float, float]
    """End point of the peg when it fell in, m, base frame; x_h of [gibbons]."""
    start: tuple[float, float]
    """First point of the path, m, base frame."""
    rests: int
    """Number of times that contact evidence stopped the path."""
    plane: Plane | None
    """The plate's surface as the search estimated it; None where no hole was found."""
    edge: tuple[float, float] | None = None
    """Lowest point of the peg in the hole, m, base frame; None where no hole was found."""
    seated: tuple[float, float] | None = None
    """Middle of the hole in the plate's surface, as the peg that was seated after this search tells it, m, base frame."""
    left: Left | None = None
    """Rest of the course that was not searched yet; None where no hole was found."""
    excess: float = 0.0
    """Length by which the peg reached further from the hand than the job states, m, by its first touch-down."""
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Force that the arm reported in free air, which was taken from its readings since, N, base frame."""
    noise: float = 0.0
    """Standard deviation of a component of that force, N."""


def run(
    params: SpraySearchParams,
    ctx: SkillContext,
    belief: Belief = ANYWHERE,
    make_evidence: Callable[[SpraySearchParams, SurfaceEstimate, float], EdgeEvidence] = EdgeEvidence,
) -> SpraySearchResult:
    """Search the area from a random corner or point of it until the peg's edge falls into the hole.

    Args:
        params: Parameters of the search.
        ctx: The skill's context.
        belief: Likely place of the hole, which is searched first, and what earlier attempts have not searched yet.
        make_evidence: Makes what watches for the edge.

    Returns:
        Where the tip fell in, or why the search ended without a fall.
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
    """Let the peg slide on, until it is in the hole, or the time is up, or it is to be lifted.

    Args:
        params: Parameters of the search.
        ctx: The skill's context.
        sweep: The peg on its way.
        spent: Time that the search has taken so far, s.

    Returns:
        The scan in which it was judged to be in the hole, if it was, and the time that the search has taken, s.
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
    """Return the distribution of the hole's place for a first attempt, from the job's prior; later attempts have their own."""
    prior = ctx.job.hole.prior
    return belief if prior is None or belief.failed else replace(belief, likely=prior)


def _referenced(plane: Plane, params: SpraySearchParams, ctx: SkillContext, sweep: SearchSweep) -> Plane:
    """Return the plate's surface after what the peg has slipped along the fingers on it was taken into its length in the hand.

    Under a peg that slips up into the hand the plate seems to have sunk where it was touched down on; a tilted plate does not.
    """
    touched = sweep.touched
    if touched is None or not ctx.peg.is_length_known:
        return plane
    sunk = plane.depth(touched) / float(plane.normal[2])
    excess = excess_of(sunk, sweep.axis, params.length_bound, has_touched=True)
    if not excess:
        return plane
    logger.info("peg: has slipped by %.1f mm along the fingers on the plate", -1e3 * excess)
    ctx.note_touch(excess)
    return Plane(plane.point - excess * float(sweep.axis[2]) * UP, plane.normal)


def _point(tip: Vector) -> tuple[float, float, float]:
    return float(tip[0]), float(tip[1]), float(tip[2])
