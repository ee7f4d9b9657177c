"""Table of skills and programs: config, recipes, PLC map, margins and records derive from it.

To add a skill, write one module with its parameters, result and `run`, and add one entry here.
"""

from dataclasses import replace

from skills import grasp_from_rack, handling, recover, release_and_retract
from skills.contract import Outcome, Reason, SkillContext, SkillResult
from skills.entry import Catalogue, Claim, Program, Skill, SkillSet
from skills.flow import StageRecord, in_order, run_stage
from skills.insert import spiral_adjust, tactile_insert
from skills.insert.spiral_params import SpiralAdjustParams
from skills.plan import InsertionPlan, plan_insertion
from skills.search import spray_search
from skills.search.belief import Belief
from skills.search.course import ANYWHERE
from skills.search.decoys import Decoy, decoy_at
from skills.search.params import SpraySearchParams
from skills.search.surface import Plane, nominal

RETRIED = (Reason.NOT_ALIGNED, Reason.NOT_SEATED)
"""Reasons of a failure after which `insert_peg` searches again."""


def insert_peg(skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
    """Take a peg, find the hole, align and seat the peg, and release it.

    If the peg turns out not to be in the hole, search again. A decoy does not count as a retry until `search.timeout` is over. After a
    failure, recover. The run's outcome is that of the first stage that failed and was not retried; without such a stage it is success.
    """
    records, belief, attempt, began = GRASP.run(skills, ctx), ANYWHERE, 0, ctx.devices.clock.now()
    plan = plan_of(skills, ctx)
    while records[-1].result.outcome is Outcome.SUCCESS or records[-1].retried:
        tried = find_and_seat(skills, ctx, belief)
        records += tried
        found, last = tried[0].result, tried[-1].result
        if last.outcome is Outcome.SUCCESS:
            records += RELEASE.run(skills, ctx)
            break
        is_in_time = ctx.devices.clock.now() - began < plan.search.timeout
        decoy = _decoy(found, last, ctx) if plan.retries and is_in_time else None
        if decoy is None and (attempt == plan.retries or last.reason not in RETRIED):
            break
        belief, attempt = _learnt(belief, found, decoy, ctx), attempt + (decoy is None)
        records[-1] = replace(records[-1], retried=True)
    return records + _recovery(skills, ctx, records[-1].result)


def _recovery(skills: SkillSet, ctx: SkillContext, last: SkillResult) -> list[StageRecord]:
    """Recover after a failure, but not after a stop: the arm must then stay at rest."""
    is_failed = last.outcome is Outcome.FAILURE and last.reason is not Reason.STOPPED
    return RECOVER.run(skills, ctx) if is_failed else []


def find_and_seat(skills: SkillSet, ctx: SkillContext, belief: Belief = ANYWHERE) -> list[StageRecord]:
    """Find the hole, align the peg and seat it, using the surface estimate of the search; stop at the first failed stage."""
    found = run_stage(SEARCH.name, lambda c: _search(skills, c, belief), ctx)
    if found.result.outcome is not Outcome.SUCCESS:
        return [found]
    plane, tries = None, 0
    if isinstance(found.result, spray_search.SpraySearchResult) and found.result.edge is not None:
        plane, tries = found.result.plane, belief.tries_at(found.result.edge, ctx.job.hole.part.inscribed)
    ctx.peg = replace(ctx.peg, surface=plane or ctx.peg.surface)
    tried = in_order(
        [
            (INSERT.name, lambda c: _insert(skills, c, plane, tries)),
            (ADJUST.name, lambda c: _adjust(skills, c, plane, tries)),
        ],
        ctx,
    )
    if tried[-1].result.outcome is Outcome.SUCCESS and isinstance(found.result, spray_search.SpraySearchResult):
        found = replace(found, result=replace(found.result, seated=_place_of_hole(ctx, plane)))
    return [found, *tried]


def _place_of_hole(ctx: SkillContext, plane: Plane | None) -> tuple[float, float]:
    """Return the position of a seated peg in the plate's surface, m, base frame.

    A seated peg is parallel to the normal, so theta, which has the larger error, is not needed. Sideways forces can have
    moved the peg between the pads, so the skin's offset of the peg's axis from the finger centre is added.
    """
    seen, plane = ctx.observe(), plane or nominal(ctx.job.hole)
    centre = seen.arm.tcp.position + seen.peg.offset * seen.arm.tcp.rotation[:, 1]
    x, y, _ = centre + plane.depth(centre) * plane.normal
    return float(x), float(y)


def _search(skills: SkillSet, ctx: SkillContext, belief: Belief = ANYWHERE) -> SkillResult:
    return handling.find(plan_of(skills, ctx), ctx, belief)


def _learnt(belief: Belief, found: SkillResult, decoy: Decoy | None, ctx: SkillContext) -> Belief:
    """Return the prior of the next attempt, given the result of this attempt's search and the decoy that it met, if any."""
    if not isinstance(found, spray_search.SpraySearchResult) or found.edge is None:
        return belief
    if decoy is not None:
        return belief.past(decoy, found.left)
    return belief.after(found.edge, ctx.job.hole.part.inscribed, found.left)


def _decoy(found: SkillResult, last: SkillResult, ctx: SkillContext) -> Decoy | None:
    """Return the decoy in which the attempt ended; None if the peg leans, because it is then in no decoy, or if the search skips no decoys."""
    if not isinstance(found, spray_search.SpraySearchResult) or found.edge is None:
        return None
    if not isinstance(last, spiral_adjust.SpiralAdjustResult) or last.reason is Reason.NOT_ALIGNED:
        return None
    x, y, _ = ctx.observe().tip
    return decoy_at(found.edge, (float(x), float(y)), last.depth, ctx.job.hole)


def _insert(skills: SkillSet, ctx: SkillContext, plane: Plane | None = None, attempt: int = 0) -> SkillResult:
    return handling.insert(plan_of(skills, ctx, attempt), ctx, plane)


def _adjust(skills: SkillSet, ctx: SkillContext, plane: Plane | None = None, attempt: int = 1) -> SkillResult:
    return handling.adjust(plan_of(skills, ctx, attempt), ctx, plane)


def plan_of(skills: SkillSet, ctx: SkillContext, attempt: int = 0) -> InsertionPlan:
    """Return the figures in force for the job, with the grip that the peg in the hand is assumed to have."""
    return plan_insertion(skills, ctx.job.peg, ctx.job.hole, ctx.peg.grip_share, attempt)


GRASP = Skill(
    name="grasp_from_rack",
    code=101,
    stage=1,
    section="grasp",
    params=grasp_from_rack.GraspFromRackParams,
    perform=grasp_from_rack.run,
    starts_empty=True,
    claim=Claim.HELD,
)
SEARCH = Skill(
    name="spray_search",
    code=102,
    stage=2,
    section="search",
    params=SpraySearchParams,
    perform=spray_search.run,
    by_part=_search,
    steered=("gains",),
    counts=True,
)
INSERT = Skill(
    name="tactile_insert",
    code=103,
    stage=3,
    section="insert",
    params=tactile_insert.TactileInsertParams,
    perform=tactile_insert.run,
    by_part=_insert,
    steered=("gains",),
    counts=True,
)
ADJUST = Skill(
    name="spiral_adjust",
    code=104,
    stage=4,
    section="adjust",
    params=SpiralAdjustParams,
    perform=spiral_adjust.run,
    by_part=_adjust,
    steered=("gains",),
    counts=True,
    claim=Claim.SEATED,
)
RELEASE = Skill(
    name="release_and_retract",
    code=105,
    stage=5,
    section="release",
    params=release_and_retract.ReleaseAndRetractParams,
    perform=release_and_retract.run,
    claim=Claim.LEFT,
)
RECOVER = Skill(
    name="recover",
    code=106,
    stage=6,
    section="recover",
    params=recover.RecoverParams,
    perform=recover.run,
    claim=Claim.FREED,
)

CATALOGUE = Catalogue(
    Program(
        name="insert_peg",
        code=100,
        run=insert_peg,
        stages=tuple(skill.name for skill in (GRASP, SEARCH, INSERT, ADJUST, RELEASE)),
        starts_empty=True,
        claim=Claim.INSERTED,
    ),
    GRASP,
    SEARCH,
    INSERT,
    ADJUST,
    RELEASE,
    RECOVER,
)
