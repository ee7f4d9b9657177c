"""Plan of an insertion: every speed, push, time and threshold in force, from the config, the part, the grip and the attempt; pure.

Skills take their figures from the plan as they are; only `plan_insertion` derives figures from others.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from drivers.config_model import ConfigModel
from drivers.part.contract import Part
from drivers.parts import Hole, Peg
from skills.corner.params import CornerParams
from skills.entry import SkillSet
from skills.grasp_from_rack import GraspFromRackParams
from skills.insert.grip import Grip, grip_of
from skills.insert.spiral_params import SpiralAdjustParams
from skills.insert.tactile_insert import TactileInsertParams
from skills.motion import Gains
from skills.pace import Pace, scaled, within
from skills.paper.params import PaperParams
from skills.search.params import SpraySearchParams
from skills.search.size import fastest, firm, shallow

P = TypeVar("P", bound=ConfigModel)

FIRST_STALL = 0.4
"""Share of `adjust.stall_timeout` in the first of several attempts, fraction: a new search takes 2.5 s and frees most jammed pegs.
Source: docs/tried/adjustment.md.
"""
AT_BOTTOM = 2.0
"""Factor on the stall timeout of a peg near the bottom, ratio: the depth gain of the last millimetre can stay below `adjust.jammed`."""
GRIP, ARM, ATTEMPT = "grasp.force", "arm.model", "attempt"
"""Reasons of figures that differ from the config: the load that the pads bear, the arm's limits, the number of the attempt."""


@dataclass(frozen=True, slots=True)
class InsertionPlan:
    """Figures in force in one attempt of an insertion."""

    search: SpraySearchParams
    insert: TactileInsertParams | None
    """None for a peg with corners."""
    adjust: SpiralAdjustParams
    corner: CornerParams | None
    """Figures of the skills for a peg with corners; None for a round peg."""
    paper: PaperParams | None
    """Figures of the printed skills of [gibbons]; None if none is used."""
    others: Mapping[str, ConfigModel]
    """Figures of the other skills, by section."""
    retries: int
    """Number of further searches if the peg turns out not to be in the hole."""
    reasons: Mapping[str, tuple[str, ...]]
    """What changed a figure of the config, by the figure's name with its sections: keys, the arm, or the attempt."""

    @property
    def sections(self) -> dict[str, ConfigModel]:
        """Figures of all sections in use, by name."""
        named = {"search": self.search, "insert": self.insert, "corner": self.corner}
        found = {**self.others, **named, "adjust": self.adjust, "paper": self.paper}
        return {name: params for name, params in found.items() if params is not None}

    @property
    def capped(self) -> tuple[str, ...]:
        """Names of the speeds that the arm's limits reduce."""
        return tuple(name for name, reasons in self.reasons.items() if ARM in reasons)

    @property
    def steered(self) -> dict[str, Gains]:
        """Gains in loops over the skin's measurements, by config key, in addition to those of the catalogue of skills."""
        gains: dict[str, Gains] = {}
        if self.corner is not None:
            gains |= {"corner.insert.gains": self.corner.insert.gains, "corner.adjust.gains": self.corner.adjust.gains}
        if self.paper is not None:
            gains |= {f"paper.{name}.gains": getattr(self.paper, name).gains for name in self.paper.skills}
        return gains


@dataclass(slots=True)
class _Stage(Generic[P]):
    """Figures of one section while they are derived, and what changed each of them."""

    name: str
    params: P
    reasons: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def become(self, why: str, params: P) -> None:
        """Take new figures, and note the reason of those that differ."""
        if params is self.params:
            return
        before = figures(self.params, self.name)
        for name, value in figures(params, self.name).items():
            if before[name] != value:
                self.reasons[name] = (*self.reasons.get(name, ()), why)
        self.params = params


def is_cornered(part: Part) -> bool:
    """Return True if a part of this kind searches with a corner and needs the section [corner]; the printed skills insert the others."""
    return {"round": False, "rectangular": True}[part.kind]


def figures(params: ConfigModel, place: str) -> dict[str, object]:
    """Return all figures of a section, by name with sections."""
    found: dict[str, object] = {}
    for name, value in vars(params).items():
        found |= figures(value, f"{place}.{name}") if isinstance(value, ConfigModel) else {f"{place}.{name}": value}
    return found


def plan_insertion(skills: SkillSet, peg: Peg, hole: Hole, grip_share: float = 1.0, attempt: int = 0) -> InsertionPlan:
    """Return the figures in force.

    Args:
        skills: Parameters of the config.
        peg: The part.
        hole: Its hole.
        grip_share: Assumed share of the grip after slips, fraction.
        attempt: Number of tries at the same place that failed.
    """
    grip = grip_of(skills.section("grasp", GraspFromRackParams), grip_share)
    search = _Stage("search", skills.section("search", SpraySearchParams))
    insert = _Stage("insert", skills.section("insert", TactileInsertParams))
    adjust = _Stage("adjust", skills.section("adjust", SpiralAdjustParams))
    corner = _optional("corner", skills.corner if is_cornered(peg.part) else None)
    paper = _optional("paper", skills.paper)
    adjust.become(GRIP, grip.adjusting(adjust.params, peg.length))
    if corner is None:
        _over_the_edge(search, insert, grip, peg, attempt)
        _first_of_several(adjust, attempt, skills.retries)
    else:
        _over_a_corner(search, corner, grip, peg, attempt)
    most = fastest(search.params, hole.part.inscribed)
    if search.params.speed > most:
        search.become("hole", _but(search.params, speed=most))
    adjust.become("adjust.stall_timeout", _but(adjust.params, stall_at_bottom=AT_BOTTOM * adjust.params.stall_timeout))
    used = {"search": search, "insert": None if corner else insert, "adjust": adjust, "corner": corner, "paper": paper}
    others = {name: _Stage(name, params) for name, params in skills.sections.items() if name not in used}
    stages = {**others, **used}
    return InsertionPlan(
        **{name: _in_force(stage, skills.pace) for name, stage in used.items()},
        others={name: _in_force(stage, skills.pace) for name, stage in others.items()},
        retries=skills.retries if corner is None else corner.params.retries,
        reasons=_reasons(stages.values()),
    )


def _optional(name: str, params: P | None) -> _Stage[P] | None:
    """Return the stage of a section that a config can leave out."""
    return None if params is None else _Stage(name, params)


def _in_force(stage: _Stage[Any] | None, pace: Pace) -> Any:
    """Return the figures of a stage at a pace; None without a stage."""
    if stage is None:
        return None
    stage.become("speed_scale", scaled(stage.params, pace.scale))
    stage.become(ARM, within(stage.params, pace))
    return stage.params


def _reasons(stages: Iterable[_Stage[Any] | None]) -> dict[str, tuple[str, ...]]:
    """Return what changed each figure of the stages."""
    return {name: why for stage in stages if stage is not None for name, why in stage.reasons.items()}


def _first_of_several(adjust: _Stage[SpiralAdjustParams], attempt: int, retries: int) -> None:
    """Shorten the stall timeout in the first of several attempts."""
    if attempt == 0 < retries:
        adjust.become(ATTEMPT, _but(adjust.params, stall_timeout=FIRST_STALL * adjust.params.stall_timeout))


def _over_the_edge(
    search: _Stage[SpraySearchParams],
    insert: _Stage[TactileInsertParams],
    grip: Grip,
    peg: Peg,
    attempt: int,
) -> None:
    """Derive the figures of a round peg, which falls into the hole over its edge."""
    search.become("peg.diameter", firm(search.params, peg.part.thickness))
    search.become(GRIP, grip.searching(search.params))
    search.become("peg.diameter", shallow(search.params, peg.part.thickness))
    insert.become(GRIP, grip.inserting(insert.params))
    if attempt > 0:
        share = min(insert.params.steady_rate / insert.params.turn_rate, 1.0)
        rate, run_up = share * insert.params.turn_rate, insert.params.turn_run_up / share
        insert.become(ATTEMPT, _but(insert.params, turn_rate=rate, turn_run_up=run_up))


def _over_a_corner(
    search: _Stage[SpraySearchParams], corner: _Stage[CornerParams], grip: Grip, peg: Peg, attempt: int
) -> None:
    """Derive the figures of a peg that searches with a corner and is turned until it drops in."""
    given = corner.params
    search.become("corner", given.searching(search.params))
    search.become(GRIP, grip.searching(search.params))
    centre = given.insert.centres[attempt % len(given.insert.centres)]
    corner.become(ATTEMPT, _but(given, insert=_but(given.insert, centre=centre)))
    raising = grip.raising(corner.params.insert, given.tilt, peg)
    corner.become(GRIP, _but(given, insert=raising, adjust=grip.entering(given.adjust, given.insert.tilt, peg)))


def _but(params: P, **changes: object) -> P:
    return params.model_copy(update=changes)
