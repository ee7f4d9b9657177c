"""What the catalogue says of a skill or a program, and the checks that keep two of them apart."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Generic, TypeVar

from drivers.errors import ConfigError
from skills.contract import Reason, SkillContext, SkillParams, SkillResult
from skills.corner import CornerParams
from skills.flow import StageRecord, run_stage
from skills.motion import Gains

P = TypeVar("P", bound=SkillParams)


@dataclass(frozen=True, slots=True, kw_only=True)
class Skill(Generic[P]):
    """One skill: everything that config, line, margins and records derive from it."""

    name: str
    """Under which a technician asks for it and runs go on record."""
    code: int
    """Command code on the line; skills and programs start at 100. A code that was once given stays."""
    stage: int
    """Number of its stage on the line, from 1; a number that was once given stays."""
    section: str
    """Section of the config, and of recipes, that holds its parameters."""
    params: type[P]
    perform: Callable[[P, SkillContext], SkillResult]
    """`run` of the skill's module."""
    by_part: "Callable[[SkillSet, SkillContext], SkillResult] | None" = None
    """Used instead of `perform` where the part decides how the skill is done."""
    steered: tuple[str, ...] = ()
    """Parameters of type `Gains` that act on what the skin tells; their stability is checked when a config is loaded."""
    counts: bool = False
    """Its time is part of a run's total."""
    starts_empty: bool = False
    """It begins with an empty hand and takes a fresh peg."""
    reasons: type[IntEnum] | None = None
    """Its own words for why it ended so, beside those of `Reason`; numbers from 100 on."""

    def run(self, skills: "SkillSet", ctx: SkillContext) -> list[StageRecord]:
        """Run the skill alone, with its own parameters out of `skills`."""

        def step(ctx: SkillContext) -> SkillResult:
            return self.perform(skills[self], ctx) if self.by_part is None else self.by_part(skills, ctx)

        return [run_stage(self.name, step, ctx)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Program:
    """Several skills, run under one command."""

    name: str
    """Under which a technician asks for it and runs go on record."""
    code: int
    """Command code on the line; skills and programs start at 100. A code that was once given stays."""
    run: "Callable[[SkillSet, SkillContext], list[StageRecord]]"
    """Runs the skills and returns the stages in the order in which they ended."""
    starts_empty: bool = False
    """It begins with an empty hand and takes a fresh peg."""


@dataclass(frozen=True, slots=True)
class SkillSet:
    """The parameters that a run is made with: `skills[SEARCH]` are those of the search, typed as the search has them."""

    sections: Mapping[str, SkillParams]
    """By name of the section."""
    corner: CornerParams | None
    """For a peg with corners, whose skills stand in for those of a round one under their names."""
    retries: int
    """How often the search begins anew when the peg turns out not to be in the hole; 0 in [gibbons]."""

    def __getitem__(self, skill: Skill[P]) -> P:
        params = self.sections[skill.section]
        assert isinstance(params, skill.params)
        return params


Entry = Program | Skill[Any]
FIRST_OWN_REASON = 100
"""Reasons of a single skill begin here; those below are shared by all."""


class Catalogue(Mapping[str, Entry]):
    """Skills and programs by name, and the tables that the rest of the cell derives from them."""

    def __init__(self, *entries: Entry) -> None:
        """Take the entries and make sure that none is in another's way.

        Raises:
            ConfigError: One line that names the entry, what it claims and who has it.
        """
        skills = sorted((entry for entry in entries if isinstance(entry, Skill)), key=lambda skill: skill.stage)
        _require_distinct("name", ((entry.name, entry.name) for entry in entries))
        _require_distinct("command code", ((entry.code, entry.name) for entry in entries))
        _require_distinct("stage", ((skill.stage, skill.name) for skill in skills))
        _require_distinct("config section", ((skill.section, skill.name) for skill in skills))
        for skill in skills:
            _require_sound(skill)
        own = [(reason, skill.name) for skill in skills for reason in skill.reasons or ()]
        _require_distinct("reason", ((reason.value, name) for reason, name in own))
        _require_distinct("reason", ((reason.name, name) for reason, name in own))
        self._entries = {entry.name: entry for entry in entries}
        self.by_code = {entry.code: entry for entry in entries}
        self.skills: tuple[Skill[Any], ...] = tuple(skills)
        """By number of their stages."""
        self.stages = {skill.stage: skill.name for skill in skills}
        """Name of each stage by its number."""
        self.counted = tuple(skill.name for skill in skills if skill.counts)
        """Stages whose times make up the total of a run."""
        self.reasons = {reason.value: reason.name for reason in (*Reason, *(reason for reason, _ in own))}
        """What each number in a run's reason means."""

    def __getitem__(self, name: str) -> Entry:
        return self._entries[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def in_places(self, times: Mapping[str, float]) -> tuple[float, ...]:
        """Return the times of stages, given by name, each at the place of its number; 0 where there is none."""
        return tuple(times.get(self.stages.get(number, ""), 0.0) for number in range(1, max(self.stages) + 1))

    def stage_number(self, name: str) -> int:
        """Return the number of a stage on the line; 0 for the empty name, before the first.

        Raises:
            ConfigError: No skill has that name.
        """
        entry = self._entries.get(name)
        if isinstance(entry, Skill):
            return entry.stage
        if name == "":
            return 0
        raise ConfigError(f"skill catalogue: stage {name!r}: no such skill; {', '.join(self.stages.values())} allowed")


def _require_distinct(what: str, claims: Iterable[tuple[Any, str]]) -> None:
    owners: dict[Any, str] = {}
    for value, name in claims:
        if value in owners:
            raise ConfigError(f"skill catalogue: {name}: {what} {value} is that of {owners[value]}; a free one allowed")
        owners[value] = name


def _require_sound(skill: Skill[Any]) -> None:
    """Make sure that what an entry says of itself can be true."""
    if skill.stage < 1:
        raise ConfigError(f"skill catalogue: {skill.name}: stage {skill.stage}: numbers from 1 on allowed")
    for name in skill.steered:
        field = skill.params.model_fields.get(name)
        if field is None or field.annotation is not Gains:
            raise ConfigError(f"skill catalogue: {skill.name}: steered {name!r}: a parameter of type Gains allowed")
    for reason in skill.reasons or ():
        if reason.value < FIRST_OWN_REASON or reason.name in Reason.__members__:
            raise ConfigError(
                f"skill catalogue: {skill.name}: reason {reason.value} {reason.name}: a word of its own,"
                f" numbered from {FIRST_OWN_REASON} on, allowed"
            )
