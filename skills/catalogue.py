"""The explicit table of skills and programs; nothing registers itself."""

from collections.abc import Callable
from dataclasses import dataclass

from drivers.parts import ConfigModel
from skills import grasp_from_rack, recover, release_and_retract, spiral_adjust, spray_search, tactile_insert
from skills.contract import Outcome, Reason, SkillContext
from skills.flow import StageRecord, in_order, run_stage


class SkillSet(ConfigModel):
    """The parameters of every skill, as the sections of a config file."""

    grasp: grasp_from_rack.GraspFromRackParams
    search: spray_search.SpraySearchParams
    insert: tactile_insert.TactileInsertParams
    adjust: spiral_adjust.SpiralAdjustParams
    release: release_and_retract.ReleaseAndRetractParams
    recover: recover.RecoverParams


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
    return [run_stage("spray_search", lambda c: spray_search.run(skills.search, c), ctx)]


def insert(skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
    """Align the peg whose tip is in the hole."""
    return [run_stage("tactile_insert", lambda c: tactile_insert.run(skills.insert, c), ctx)]


def adjust(skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
    """Seat the aligned peg."""
    return [run_stage("spiral_adjust", lambda c: spiral_adjust.run(skills.adjust, c), ctx)]


def release(skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
    """Let go of a seated peg."""
    return [run_stage("release_and_retract", lambda c: release_and_retract.run(skills.release, c), ctx)]


def recover_cell(skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
    """Free hand and arm after a failure."""
    return [run_stage("recover", lambda c: recover.run(skills.recover, c), ctx)]


def insert_peg(skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
    """Take a peg, find the hole, align, seat, let go; after a failure free hand and arm.

    The run's outcome is that of its first stage that did not succeed, or success.
    """
    records = in_order(
        [
            ("grasp_from_rack", lambda c: grasp_from_rack.run(skills.grasp, c)),
            ("spray_search", lambda c: spray_search.run(skills.search, c)),
            ("tactile_insert", lambda c: tactile_insert.run(skills.insert, c)),
            ("spiral_adjust", lambda c: spiral_adjust.run(skills.adjust, c)),
            ("release_and_retract", lambda c: release_and_retract.run(skills.release, c)),
        ],
        ctx,
    )
    last = records[-1].result
    if last.outcome is Outcome.FAILURE and last.reason is not Reason.STOPPED:
        records += recover_cell(skills, ctx)
    return records


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
