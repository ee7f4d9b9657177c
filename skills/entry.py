"""Entries of the catalogue of skills and programs, and the checks that their names and numbers are distinct."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Any, Generic, TypeVar

from drivers.errors import ConfigError
from skills.contract import Reason, SkillContext, SkillParams, SkillResult
from skills.corner.params import CornerParams
from skills.flow import StageRecord, run_stage
from skills.motion import Gains
from skills.pace import Pace, at_pace
from skills.paper.params import PaperParams

P = TypeVar("P", bound=SkillParams)


class Claim(Enum):
    """Claim made by a success; the cell compares it with the evidence of its devices before it reports the success."""

    NOTHING = "nothing"
    HELD = "held"
    """The hand holds a peg."""
    SEATED = "seated"
    """The peg in the hand is seated."""
    LEFT = "left"
    """The hand released a seated peg, and the peg stayed."""
    INSERTED = "inserted"
    """The run seated and released a peg, and the peg stayed."""
    FREED = "freed"
    """The hand is open, and no peg blocks the next run."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Skill(Generic[P]):
    """One skill: the source of its config section, PLC numbers, stability margins and records."""

    name: str
    """Name of the skill in commands and records."""
    code: int
    """Command code on the PLC line, from 100; a code is never reused."""
    stage: int
    """Number of its stage on the PLC line, from 1; a number is never reused."""
    section: str
    """Section of the config, and of recipes, that holds its parameters."""
    params: type[P]
    perform: Callable[[P, SkillContext], SkillResult]
    """The function `run` of the skill's module."""
    by_part: "Callable[[SkillSet, SkillContext], SkillResult] | None" = None
    """Function that replaces `perform` if the part selects the method."""
    steered: tuple[str, ...] = ()
    """Names of the parameters of type `Gains` in a loop over the skin's measurements; loading a config checks their
    stability.
    """
    counts: bool = False
    """True if the skill's time is part of a run's total."""
    starts_empty: bool = False
    """True if the skill starts with an empty hand and takes a new peg."""
    claim: Claim = Claim.NOTHING
    """Claim made by a success of the skill."""
    reasons: type[IntEnum] | None = None
    """Reasons specific to the skill, in addition to `Reason`; their numbers start at 100."""

    def run(self, skills: "SkillSet", ctx: SkillContext) -> list[StageRecord]:
        """Run the skill alone, with its own parameters from `skills`."""

        def step(ctx: SkillContext) -> SkillResult:
            return (
                self.perform(at_pace(skills[self], skills.pace), ctx)
                if self.by_part is None
                else self.by_part(skills, ctx)
            )

        return [run_stage(self.name, step, ctx)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Program:
    """Sequence of skills run by one command."""

    name: str
    """Name of the program in commands and records."""
    code: int
    """Command code on the PLC line, from 100; a code is never reused."""
    run: "Callable[[SkillSet, SkillContext], list[StageRecord]]"
    """Function that runs the skills and returns the stages in the order in which they ended."""
    stages: tuple[str, ...] = ()
    """Names of the stages of a fully successful run, in order; the progress is computed from them."""
    starts_empty: bool = False
    """True if the program starts with an empty hand and takes a new peg."""
    claim: Claim = Claim.NOTHING
    """Claim made by a success of the program."""


@dataclass(frozen=True, slots=True)
class SkillSet:
    """Parameters of a run; `skills[SEARCH]` returns those of the search, with their type."""

    sections: Mapping[str, SkillParams]
    """Parameters of each skill, by the name of its section."""
    corner: CornerParams | None
    """Parameters for a peg with corners, whose skills replace those of a round peg under the same names; None if not
    configured.
    """
    retries: int
    """Number of further searches if the peg turns out not to be in the hole; 0 in [gibbons]."""
    paper: PaperParams | None
    """Skills that use the printed method of [gibbons], and their parameters; None for none."""
    pace: Pace
    """Factor on all speeds, and the arm's limits."""

    def __getitem__(self, skill: Skill[P]) -> P:
        return self.section(skill.section, skill.params)

    def section(self, name: str, of: type[P]) -> P:
        """Return the parameters of a section, which are of the type `of`."""
        params = self.sections[name]
        assert isinstance(params, of)
        return params


Entry = Program | Skill[Any]
FIRST_OWN_REASON = 100
"""First number of a single skill's own reasons; smaller numbers are shared by all skills."""


class Catalogue(Mapping[str, Entry]):
    """Skills and programs by name, and the tables derived from them."""

    def __init__(self, *entries: Entry) -> None:
        """Store the entries and check that their names, codes, stages, sections and reasons are distinct.

        Raises:
            ConfigError: Two entries have the same value; the message names both entries and the value.
        """
        skills = sorted((entry for entry in entries if isinstance(entry, Skill)), key=lambda skill: skill.stage)
        own = _own_reasons(skills)
        _require_sound(entries, skills, own)
        self._entries = {entry.name: entry for entry in entries}
        self.by_code = {entry.code: entry for entry in entries}
        self.skills: tuple[Skill[Any], ...] = tuple(skills)
        """Skills in the order of their stage numbers."""
        self.stages = {skill.stage: skill.name for skill in skills}
        """Name of each stage by its number."""
        self.counted = tuple(skill.name for skill in skills if skill.counts)
        """Names of the stages whose times make up the total of a run."""
        self.reasons = {reason.value: reason.name for reason in (*Reason, *(reason for reason, _ in own))}
        """Name of each reason by its number."""

    def __getitem__(self, name: str) -> Entry:
        return self._entries[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def in_places(self, times: Mapping[str, float]) -> tuple[float, ...]:
        """Return the times of the stages, s, in the order of their numbers; 0 if a stage has no time."""
        return tuple(times.get(self.stages.get(number, ""), 0.0) for number in range(1, max(self.stages) + 1))

    def require_known(self, record: StageRecord) -> None:
        """Check that the stage and the reason of a record have numbers on the PLC line.

        Raises:
            ConfigError: No skill has that name, or the reason is neither in `Reason` nor in the entry's `reasons`.
        """
        self.stage_number(record.name)
        reason = record.result.reason
        if self.reasons.get(reason.value) != reason.name:
            raise ConfigError(
                f"skill catalogue: {record.name}: reason {reason.value} {reason.name}: not in `reasons` of its entry;"
                " one of those, or of `Reason`, allowed"
            )

    def stage_number(self, name: str) -> int:
        """Return the number of a stage on the PLC line; 0 for the empty name, before the first stage.

        Raises:
            ConfigError: No skill has that name.
        """
        entry = self._entries.get(name)
        if isinstance(entry, Skill):
            return entry.stage
        if name == "":
            return 0
        raise ConfigError(f"skill catalogue: stage {name!r}: no such skill; {', '.join(self.stages.values())} allowed")


def _own_reasons(skills: Sequence[Skill[Any]]) -> list[tuple[IntEnum, str]]:
    """Return the reasons that skills add, each with its skill's name."""
    return [(reason, skill.name) for skill in skills for reason in skill.reasons or ()]


def _require_distinct(what: str, claims: Iterable[tuple[Any, str]]) -> None:
    owners: dict[Any, str] = {}
    for value, name in claims:
        if value in owners:
            owner = "another entry" if owners[value] == name else owners[value]
            raise ConfigError(f"skill catalogue: {name}: {what} {value} is that of {owner}; a free one allowed")
        owners[value] = name


def _require_sound(entries: Sequence[Entry], skills: Sequence[Skill[Any]], own: Sequence[tuple[IntEnum, str]]) -> None:
    """Check that names and numbers are distinct and the fields of each skill consistent; `own` has reasons and their skills."""
    for what, field, owners in (
        ("name", "name", entries),
        ("command code", "code", entries),
        ("stage", "stage", skills),
        ("config section", "section", skills),
    ):
        _require_distinct(what, ((getattr(entry, field), entry.name) for entry in owners))
    for skill in skills:
        _require_consistent(skill)
    for field in ("value", "name"):
        _require_distinct("reason", ((getattr(reason, field), name) for reason, name in own))


def _require_consistent(skill: Skill[Any]) -> None:
    """Check that an entry's fields are consistent."""
    if skill.stage < 1:
        raise ConfigError(f"skill catalogue: {skill.name}: stage {skill.stage}: numbers from 1 on allowed")
    for name in skill.steered:
        field = skill.params.model_fields.get(name)
        if field is None or not (isinstance(field.annotation, type) and issubclass(field.annotation, Gains)):
            raise ConfigError(f"skill catalogue: {skill.name}: steered {name!r}: a parameter of type Gains allowed")
    for reason in skill.reasons or ():
        where = f"skill catalogue: {skill.name}: reason {reason.value} {reason.name}"
        if reason.value < FIRST_OWN_REASON:
            raise ConfigError(
                f"{where}: smaller numbers are for the reasons of all skills; {FIRST_OWN_REASON} or more allowed"
            )
        if reason.name in Reason.__members__:
            raise ConfigError(f"{where}: the name is that of a reason of all skills; an unused name allowed")
