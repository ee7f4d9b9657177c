"""Cover the area that contains the hole the way a spray gun does until the peg's edge falls in: [gibbons], Sec. IV."""

from dataclasses import dataclass, replace

from drivers.quantities import Vector
from skills.contract import Outcome, Reason, SkillContext, SkillResult
from skills.motion import Goal, move
from skills.pull_out import LONGEST, pull_out
from skills.search.belief import Belief
from skills.search.course import ANYWHERE, Course, make_course
from skills.search.feel import Evidence
from skills.search.params import SpraySearchParams
from skills.search.sweep import Sweep
from skills.search.tour import Left, Likely
from skills.surface import Plane, SurfaceEstimate
from skills.tactile.hole_event import HoleEvent


@dataclass(frozen=True, slots=True)
class SpraySearchResult(SkillResult):
    """Where the hole was found."""

    tip: tuple[float, float, float]
    """End point of the peg when it fell in, m, base frame; x_h of [gibbons]."""
    start: tuple[float, float]
    """First point of the path, m, base frame."""
    events: int
    """Number of events of the skin, false ones included."""
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
    surface: SurfaceEstimate | None = None,
    event: HoleEvent | None = None,
    belief: Belief = ANYWHERE,
) -> SpraySearchResult:
    """Search the area from a random corner or point of it until the peg's edge falls into the hole.

    A surface estimate that turns out to have been learnt in the wrong place is replaced by a fresh one.

    Args:
        params: Parameters of the search.
        ctx: The skill's context.
        surface: Estimate of the plate's surface to start from; None starts from one that knows nothing.
        event: Detector of hole events on the skin; None makes one as `params.event` says.
        belief: Likely place of the hole, which is searched first, and what earlier attempts have not searched yet.

    Returns:
        Where the tip fell in, or why the search ended without a fall.
    """
    course = make_course(params, ctx.job, ctx.rng, _with_prior(belief, ctx), ctx.is_length_known)
    start = (course.first[0], course.first[1])
    if (stuck := _approach(params, ctx, course)) is not None:
        return SpraySearchResult(Outcome.FAILURE, Reason.NOT_SEATED, LONGEST, _point(stuck), start, 0, 0, None)
    evidence = Evidence(
        params, surface or SurfaceEstimate(), event or HoleEvent(params.event, params.timeout), ctx.scan_period
    )
    sweep, tip = Sweep(params, ctx, course, evidence), course.first
    for seen in ctx.scan(params.timeout, holding=True):
        tip = seen.tip
        if sweep.finds(seen):
            plane, elapsed = evidence.plane(tip), seen.running
            return SpraySearchResult(
                outcome=Outcome.SUCCESS,
                reason=Reason.NONE,
                elapsed=elapsed,
                tip=_point(tip),
                start=start,
                events=evidence.events,
                rests=sweep.rests,
                plane=plane,
                edge=sweep.edge,
                left=sweep.left,
                excess=ctx.excess,
                offset=_point(ctx.zero.force),
                noise=ctx.zero.noise,
            )
        ctx.progress(seen.elapsed / params.timeout)
        ctx.follow(sweep.setpoint(seen))
    return SpraySearchResult(
        Outcome.FAILURE, Reason.NO_HOLE, params.timeout, _point(tip), start, evidence.events, sweep.rests, None
    )


def _with_prior(belief: Belief, ctx: SkillContext) -> Belief:
    """Return the belief of a first attempt as the job's prior has it; later attempts know better."""
    prior = ctx.job.hole.prior
    if prior is None or belief.failed:
        return belief
    return replace(belief, likely=Likely(prior.mean, prior.deviation))


def _approach(params: SpraySearchParams, ctx: SkillContext, course: Course) -> Vector | None:
    """Move above the first point; return where the tip is stuck if the peg, which may stand in the hole, does not come out."""
    if ctx.observe().tip[2] < course.first[2]:
        stuck = pull_out(course.first[2], params.transfer.gains, ctx)
        if stuck is not None:
            return stuck
    for _ in move(Goal(course.first, course.axis, course.closing), params.transfer, ctx, ctx.in_hand()):
        pass
    ctx.zero_wrench()
    return None


def _point(tip: Vector) -> tuple[float, float, float]:
    return float(tip[0]), float(tip[1]), float(tip[2])
