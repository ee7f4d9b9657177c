"""Handling of each kind of part: search, alignment and seating; the only module that selects skills by part and method."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from drivers.part.contract import Part
from skills import corner_adjust, corner_insert, spiral_adjust, spray_search, tactile_insert
from skills.contract import Outcome, SkillContext, SkillResult
from skills.corner import CornerParams
from skills.grasp_from_rack import GraspFromRackParams
from skills.grip import grip_of
from skills.motion import Gains
from skills.pace import Pace, at_pace
from skills.paper import adjust as paper_adjust
from skills.paper import insert as paper_insert
from skills.paper import search as paper_search
from skills.paper.params import PaperParams
from skills.search.belief import Belief
from skills.search.params import SpraySearchParams
from skills.search.size import firm, shallow
from skills.spiral_params import SpiralAdjustParams
from skills.surface import Plane


@dataclass(frozen=True, slots=True)
class Sections:
    """Config sections from which a handling is made."""

    search: SpraySearchParams
    insert: tactile_insert.TactileInsertParams
    adjust: SpiralAdjustParams
    corner: CornerParams | None
    retries: int
    """Number of further searches, key `retries` of the config."""
    grasp: GraspFromRackParams
    """Parameters of the grasp; they bound every push."""
    paper: PaperParams | None
    """Skills that use the printed method of [gibbons], and their parameters; None for none."""
    pace: Pace
    """Factor on all speeds, and the arm's limits."""
    grip_share: float = 1.0
    """Assumed share of the grip after slips, fraction."""


FIRST_STALL = 0.4
"""Share of `adjust.stall_timeout` in the first of several attempts, fraction: a new search takes 2.5 s and frees most jammed pegs.
Source: docs/tried/adjustment.md.
"""


@dataclass(frozen=True, slots=True)
class Handling:
    """Handling of one kind of part."""

    search: SpraySearchParams
    """Parameters of the search."""
    find: Callable[[SkillContext, Belief], SkillResult]
    """Function that searches for the hole, given the prior of its position."""
    insert: Callable[[SkillContext, Plane | None, int], SkillResult]
    """Function that aligns the peg, given the surface estimate of the search, if any, and the attempt's number from 0."""
    adjust: Callable[[SkillContext, Plane | None, int], SkillResult]
    """Function that seats the aligned peg, given the surface estimate and the attempt's number."""
    retries: int
    """Number of further searches if the peg turns out not to be in the hole; 0 in [gibbons]."""
    steered: Mapping[str, Gains] = field(default_factory=dict)
    """Gains in loops over the skin's measurements, by config key, in addition to those of the catalogue of skills."""
    blend: float | None = None
    """Weight of a new frame in the in-hand angle instead of `smoothing.blend`, fraction; None for no replacement."""


@dataclass(frozen=True, slots=True)
class Way:
    """Config section and constructor of the handling of one kind of part."""

    section: str
    """Config section that the handling needs."""
    make: Callable[[Part, Sections], Handling]


def _over_the_edge(part: Part, sections: Sections) -> Handling:
    grip = grip_of(sections.grasp, sections.grip_share)
    insert = at_pace(grip.inserting(sections.insert), sections.pace)
    search = at_pace(shallow(grip.searching(firm(sections.search, part.thickness)), part.thickness), sections.pace)

    def adjust(ctx: SkillContext, plane: Plane | None, attempt: int) -> SkillResult:
        params = grip.adjusting(sections.adjust, ctx.job.peg.length)
        share = stall_share(attempt, sections.retries)
        patient = params.model_copy(update={"stall_timeout": share * params.stall_timeout})
        return spiral_adjust.run(at_pace(patient, sections.pace), ctx, plane)

    return Handling(
        search=search,
        find=lambda ctx, belief: spray_search.run(search, ctx, belief=belief),
        insert=lambda ctx, plane, attempt: tactile_insert.run(insert, ctx, plane, attempt),
        adjust=adjust,
        retries=sections.retries,
    )


def stall_share(attempt: int, retries: int) -> float:
    """Return the share of the stall timeout in an attempt, counted from 0; it is below 1 in the first of several attempts."""
    return FIRST_STALL if attempt == 0 < retries else 1.0


def _over_a_corner(part: Part, sections: Sections) -> Handling:
    assert sections.corner is not None
    grip, corner = grip_of(sections.grasp, sections.grip_share), sections.corner
    search = at_pace(grip.searching(corner.searching(sections.search)), sections.pace)

    def insert(ctx: SkillContext, plane: Plane | None, attempt: int) -> SkillResult:
        params = at_pace(grip.raising(corner.insert, corner.tilt, ctx.job.peg), sections.pace)
        return corner_insert.run(params, ctx, plane, attempt)

    def adjust(ctx: SkillContext, plane: Plane | None, attempt: int) -> SkillResult:
        entering = at_pace(grip.entering(corner.adjust, corner.insert.tilt, ctx.job.peg), sections.pace)
        entered = corner_adjust.run(entering, ctx, plane)
        if entered.outcome is not Outcome.SUCCESS:
            return entered
        params = at_pace(grip.adjusting(sections.adjust, ctx.job.peg.length), sections.pace)
        seated = spiral_adjust.run(params, ctx, plane, turns_freely=True)
        return replace(seated, elapsed=entered.elapsed + seated.elapsed)

    return Handling(
        search=search,
        find=lambda ctx, belief: spray_search.run(search, ctx, belief=belief),
        insert=insert,
        adjust=adjust,
        retries=corner.retries,
        steered={"corner.insert.gains": corner.insert.gains, "corner.adjust.gains": corner.adjust.gains},
        blend=corner.blend,
    )


WAYS: Mapping[str, Way] = {"round": Way("insert", _over_the_edge), "rectangular": Way("corner", _over_a_corner)}
"""Handling of each kind of part."""


_PRINTED: Mapping[str, bool] = {"round": True, "rectangular": False}
"""Whether the printed skills insert a part of this kind."""


def is_printed_for(part: Part) -> bool:
    """Return True if the printed skills insert a part of this kind."""
    return _PRINTED[part.kind]


def handling(part: Part, sections: Sections) -> Handling:
    """Return the handling of this part."""
    made = WAYS[part.kind].make(part, sections)
    return (
        made
        if sections.paper is None
        else _as_printed(made, at_pace(sections.search, sections.pace), at_pace(sections.paper, sections.pace))
    )


def _as_printed(made: Handling, search: SpraySearchParams, paper: PaperParams) -> Handling:
    """Return a handling in which the skills named in `paper.skills` use the printed method of [gibbons]."""
    printed: dict[str, dict[str, Any]] = {
        "search": {"find": lambda ctx, belief: paper_search.run(paper.search, search, ctx)},
        "insert": {"insert": lambda ctx, plane, attempt: paper_insert.run(paper.insert, ctx)},
        "adjust": {"adjust": lambda ctx, plane, attempt: paper_adjust.run(paper.adjust, ctx)},
    }
    steered = {f"paper.{name}.gains": getattr(paper, name).gains for name in paper.skills}
    changes = {key: run for name in paper.skills for key, run in printed[name].items()}
    return replace(made, steered={**made.steered, **steered}, **changes)
