"""The explicit table of skills and programs: config, recipes, PLC map, margins and records derive from it.

A new skill is one module, with parameters, result and `run`, and one entry here; nothing registers itself.
"""

from dataclasses import replace

from skills import (
    grasp_from_rack,
    recover,
    release_and_retract,
    spiral_adjust,
    spray_search,
    tactile_insert,
)
from skills.contract import Outcome, Reason, SkillContext, SkillResult
from skills.entry import Catalogue, Program, Skill, SkillSet
from skills.flow import StageRecord, in_order, run_stage
from skills.ground import Plane
from skills.handling import Handling, Sections, handling
from skills.search.params import SpraySearchParams

RETRIED = (Reason.NOT_ALIGNED, Reason.NOT_SEATED)
"""What a new search can mend."""


def insert_peg(skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
    """Take a peg, find the hole, align, seat, let go; search again where it was not the hole; else free hand and arm.

    The run's outcome is that of its first stage that neither succeeded nor was tried again, or success.
    """
    records = GRASP.run(skills, ctx)
    for left in reversed(range(skills.retries + 1)):
        if records[-1].result.outcome is not Outcome.SUCCESS and not records[-1].retried:
            break
        records += find_and_seat(skills, ctx, skills.retries - left)
        last = records[-1].result
        if last.outcome is Outcome.SUCCESS:
            records += RELEASE.run(skills, ctx)
            break
        if left and last.reason in RETRIED:
            records[-1] = replace(records[-1], retried=True)
    last = records[-1].result
    if last.outcome is Outcome.FAILURE and last.reason is not Reason.STOPPED:
        records += RECOVER.run(skills, ctx)
    return records


def find_and_seat(skills: SkillSet, ctx: SkillContext, attempt: int = 0) -> list[StageRecord]:
    """Find the hole, align and seat the peg, on the surface that the search has felt, until a stage does not succeed."""
    found = run_stage(SEARCH.name, lambda c: _search(skills, c), ctx)
    plane = found.result.plane if isinstance(found.result, spray_search.SpraySearchResult) else None
    if found.result.outcome is not Outcome.SUCCESS:
        return [found]
    return [
        found,
        *in_order(
            [
                (INSERT.name, lambda c: _insert(skills, c, plane, attempt)),
                (ADJUST.name, lambda c: _adjust(skills, c, plane)),
            ],
            ctx,
        ),
    ]


def _search(skills: SkillSet, ctx: SkillContext) -> SkillResult:
    return spray_search.run(_handling(skills, ctx).search, ctx)


def _insert(skills: SkillSet, ctx: SkillContext, plane: Plane | None = None, attempt: int = 0) -> SkillResult:
    return _handling(skills, ctx).insert(ctx, plane, attempt)


def _adjust(skills: SkillSet, ctx: SkillContext, plane: Plane | None = None) -> SkillResult:
    return _handling(skills, ctx).adjust(ctx, plane)


def _handling(skills: SkillSet, ctx: SkillContext) -> Handling:
    sections = Sections(skills[SEARCH], skills[INSERT], skills[ADJUST], skills.corner, skills.retries)
    return handling(ctx.job.peg.part, sections)


GRASP = Skill(
    name="grasp_from_rack",
    code=101,
    stage=1,
    section="grasp",
    params=grasp_from_rack.GraspFromRackParams,
    perform=grasp_from_rack.run,
    starts_empty=True,
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
    params=spiral_adjust.SpiralAdjustParams,
    perform=spiral_adjust.run,
    by_part=_adjust,
    steered=("gains",),
    counts=True,
)
RELEASE = Skill(
    name="release_and_retract",
    code=105,
    stage=5,
    section="release",
    params=release_and_retract.ReleaseAndRetractParams,
    perform=release_and_retract.run,
)
RECOVER = Skill(name="recover", code=106, stage=6, section="recover", params=recover.RecoverParams, perform=recover.run)

CATALOGUE = Catalogue(
    Program(name="insert_peg", code=100, run=insert_peg, starts_empty=True),
    GRASP,
    SEARCH,
    INSERT,
    ADJUST,
    RELEASE,
    RECOVER,
)
