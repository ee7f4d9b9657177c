"""Search, insertion and adjustment of a part: the only module that selects skills by part and method."""

from dataclasses import replace

from skills.contract import Outcome, SkillContext, SkillResult
from skills.corner import adjust as corner_adjust
from skills.corner import insert as corner_insert
from skills.insert import spiral_adjust, tactile_insert
from skills.paper import adjust as paper_adjust
from skills.paper import insert as paper_insert
from skills.paper import search as paper_search
from skills.plan import InsertionPlan
from skills.search import spray_search
from skills.search.belief import Belief
from skills.search.surface import Plane


def find(plan: InsertionPlan, ctx: SkillContext, belief: Belief) -> SkillResult:
    """Search for the hole, given the prior of its position."""
    if plan.paper is not None and "search" in plan.paper.skills:
        return paper_search.run(plan.paper.search, plan.search, ctx)
    return spray_search.run(plan.search, ctx, belief=belief)


def insert(plan: InsertionPlan, ctx: SkillContext, plane: Plane | None) -> SkillResult:
    """Align the peg, given the surface estimate of the search, if any."""
    if plan.paper is not None and "insert" in plan.paper.skills:
        return paper_insert.run(plan.paper.insert, ctx)
    if plan.corner is not None:
        return corner_insert.run(plan.corner.insert, ctx, plane)
    assert plan.insert is not None
    return tactile_insert.run(plan.insert, ctx, plane)


def adjust(plan: InsertionPlan, ctx: SkillContext, plane: Plane | None) -> SkillResult:
    """Seat the aligned peg, given the surface estimate of the search, if any."""
    if plan.paper is not None and "adjust" in plan.paper.skills:
        return paper_adjust.run(plan.paper.adjust, ctx)
    if plan.corner is None:
        return spiral_adjust.run(plan.adjust, ctx, plane)
    entered = corner_adjust.run(plan.corner.adjust, ctx, plane)
    if entered.outcome is not Outcome.SUCCESS:
        return entered
    seated = spiral_adjust.run(plan.adjust, ctx, plane, turns_freely=True)
    return replace(seated, elapsed=entered.elapsed + seated.elapsed)
