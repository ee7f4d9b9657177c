"""The explicit table of skills and programs; nothing registers itself."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from drivers.parts import ConfigModel
from skills import (
    corner_adjust,
    corner_insert,
    grasp_from_rack,
    recover,
    release_and_retract,
    spiral_adjust,
    spray_search,
    tactile_insert,
)
from skills.contract import Outcome, Reason, SkillContext, SkillResult
from skills.flow import StageRecord, in_order, run_stage
from skills.ground import Plane
from skills.square import SquareParams


class SkillSet(ConfigModel):
    """The parameters of every skill, as the sections of a config file."""

    grasp: grasp_from_rack.GraspFromRackParams
    search: spray_search.SpraySearchParams
    insert: tactile_insert.TactileInsertParams
    adjust: spiral_adjust.SpiralAdjustParams
    release: release_and_retract.ReleaseAndRetractParams
    recover: recover.RecoverParams
    square: SquareParams | None
    """Where the peg is square; its skills then stand in for those of a round one, under their names."""
    retries: int
    """So often the search begins anew when the peg turns out not to be in the hole; 0 in [gibbons]."""


Program = Callable[[SkillSet, SkillContext], list[StageRecord]]


@dataclass(frozen=True, slots=True)
class Entry:
    """Something that a PLC or a technician can ask for."""

    name: str
    code: int
    """Command code on the line; skills and programs start at 100."""
    run: Program
    starts_empty: bool
    """It begins with an empty hand and takes a fresh peg."""


STAGES: tuple[str, ...] = (
    "grasp_from_rack",
    "spray_search",
    "tactile_insert",
    "spiral_adjust",
    "release_and_retract",
    "recover",
)
"""In the order of their numbers on the line, which start at 1."""


def grasp(skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
    """Take a peg from the rack."""
    return [run_stage("grasp_from_rack", lambda c: grasp_from_rack.run(skills.grasp, c), ctx)]


def search(skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
    """Find the hole with the peg in the hand."""
    return [run_stage("spray_search", lambda c: _search(skills, c), ctx)]


def insert(skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
    """Align the peg whose tip is in the hole."""
    return [run_stage("tactile_insert", lambda c: _insert(skills, c), ctx)]


def adjust(skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
    """Seat the aligned peg."""
    return [run_stage("spiral_adjust", lambda c: _adjust(skills, c), ctx)]


def release(skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
    """Let go of a seated peg."""
    return [run_stage("release_and_retract", lambda c: release_and_retract.run(skills.release, c), ctx)]


def recover_cell(skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
    """Free hand and arm after a failure."""
    return [run_stage("recover", lambda c: recover.run(skills.recover, c), ctx)]


RETRIED = (Reason.NOT_ALIGNED, Reason.NOT_SEATED)
"""What a new search can mend."""


def insert_peg(skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
    """Take a peg, find the hole, align, seat, let go; search again where it was not the hole; else free hand and arm.

    The run's outcome is that of its first stage that neither succeeded nor was tried again, or success.
    """
    records = grasp(skills, ctx)
    for left in reversed(range(skills.retries + 1)):
        if records[-1].result.outcome is not Outcome.SUCCESS and not records[-1].retried:
            break
        records += find_and_seat(skills, ctx, skills.retries - left)
        last = records[-1].result
        if last.outcome is Outcome.SUCCESS:
            records += release(skills, ctx)
            break
        if left and last.reason in RETRIED:
            records[-1] = replace(records[-1], retried=True)
    last = records[-1].result
    if last.outcome is Outcome.FAILURE and last.reason is not Reason.STOPPED:
        records += recover_cell(skills, ctx)
    return records


def find_and_seat(skills: SkillSet, ctx: SkillContext, attempt: int = 0) -> list[StageRecord]:
    """Find the hole, align and seat the peg, on the surface that the search has felt, until a stage does not succeed."""
    found = run_stage("spray_search", lambda c: _search(skills, c), ctx)
    plane = found.result.plane if isinstance(found.result, spray_search.SpraySearchResult) else None
    if found.result.outcome is not Outcome.SUCCESS:
        return [found]
    return [
        found,
        *in_order(
            [
                ("tactile_insert", lambda c: _insert(skills, c, plane, attempt)),
                ("spiral_adjust", lambda c: _adjust(skills, c, plane)),
            ],
            ctx,
        ),
    ]


def _search(skills: SkillSet, ctx: SkillContext) -> SkillResult:
    return spray_search.run(skills.search if skills.square is None else skills.square.searching(skills.search), ctx)


def _insert(skills: SkillSet, ctx: SkillContext, plane: Plane | None = None, attempt: int = 0) -> SkillResult:
    if skills.square is not None:
        return corner_insert.run(skills.square.insert, ctx, plane, attempt)
    return tactile_insert.run(skills.insert, ctx, plane)


def _adjust(skills: SkillSet, ctx: SkillContext, plane: Plane | None = None) -> SkillResult:
    if skills.square is not None:
        return corner_adjust.run(skills.square.adjust, ctx, plane)
    return spiral_adjust.run(skills.adjust, ctx, plane)


CATALOGUE: dict[str, Entry] = {
    entry.name: entry
    for entry in (
        Entry("insert_peg", 100, insert_peg, starts_empty=True),
        Entry("grasp_from_rack", 101, grasp, starts_empty=True),
        Entry("spray_search", 102, search, starts_empty=False),
        Entry("tactile_insert", 103, insert, starts_empty=False),
        Entry("spiral_adjust", 104, adjust, starts_empty=False),
        Entry("release_and_retract", 105, release, starts_empty=False),
        Entry("recover", 106, recover_cell, starts_empty=False),
    )
}
