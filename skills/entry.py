"""Entries of the catalogue of skills and programs, and the checks that no two of them claim the same thing."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Any, Generic, TypeVar

from drivers.errors import ConfigError
from skills.contract import Reason, SkillContext, SkillParams, SkillResult
from skills.corner import CornerParams
from skills.flow import StageRecord, run_stage
from skills.motion import Gains
from skills.paper.params import PaperParams

P = TypeVar("P", bound=SkillParams)


class Claim(Enum):
    """Claim of a success, which the cell compares with the evidence of its devices before it reports the success."""

    NOTHING = "nothing"
    HELD = "held"
    """The hand holds a peg."""
    SEATED = "seated"
    """The peg in the hand is seated."""
    LEFT = "left"
    """A seated peg was let go and stayed."""
    INSERTED = "inserted"
    """A peg was seated in this run, let go, and stayed."""
    FREED = "freed"
    """The hand is open, and no peg blocks the next run."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Skill(Generic[P]):
    """One skill: everything that config, line, margins and records derive from it."""

    name: str
    """Name under which a technician asks for the skill and its runs go on record."""
    code: int
    """Command code on the PLC line; skills and programs start at 100, and a code is never given to another."""
    stage: int
    """Number of its stage on the PLC line, from 1; a number is never given to another."""
    section: str
    """Section of the config, and of recipes, that holds its parameters."""
    params: type[P]
    perform: Callable[[P, SkillContext], SkillResult]
    """The function `run` of the skill's module."""
    by_part: "Callable[[SkillSet, SkillContext], SkillResult] | None" = None
    """Function that replaces `perform` where the part decides how the skill is done."""
    steered: tuple[str, ...] = ()
    """Names of the parameters of type `Gains` that act on what the skin tells; their stability is checked when a config
    is loaded.
    """
    counts: bool = False
    """Whether the skill's time is part of a run's total."""
    starts_empty: bool = False
    """Whether the skill begins with an empty hand and takes a fresh peg."""
    claim: Claim = Claim.NOTHING
    """What the success of the skill says."""
    reasons: type[IntEnum] | None = None
    """The skill's own words for why it ended, beside those of `Reason`; their numbers start at 100."""

    def run(self, skills: "SkillSet", ctx: SkillContext) -> list[StageRecord]:
        """Run the skill alone, with its own parameters from `skills`."""

        def step(ctx: SkillContext) -> SkillResult:
            return self.perform(skills[self], ctx) if self.by_part is None else self.by_part(skills, ctx)

        return [run_stage(self.name, step, ctx)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Program:
    """Several skills, run under one command."""

    name: str
    """Name under which a technician asks for the program and its runs go on record."""
    code: int
    """Command code on the PLC line; skills and programs start at 100, and a code is never given to another."""
    run: "Callable[[SkillSet, SkillContext], list[StageRecord]]"
    """Function that runs the skills and returns the stages in the order in which they ended."""
    stages: tuple[str, ...] = ()
    """Names of the stages of a run in which everything succeeds, in order; progress is measured by them."""
    starts_empty: bool = False
    """Whether the program begins with an empty hand and takes a fresh peg."""
    claim: Claim = Claim.NOTHING
    """What the success of the program says."""


@dataclass(frozen=True, slots=True)
class SkillSet:
    """The parameters that a run is made with: `skills[SEARCH]` are those of the search, typed as the search has them."""

    sections: Mapping[str, SkillParams]
    """Parameters of each skill, by the name of its section."""
    corner: CornerParams | None
    """Parameters for a peg with corners, whose skills replace those of a round peg under the same names; None without
    them.
    """
    retries: int
    """Number of further searches when the peg turns out not to be in the hole; 0 in [gibbons]."""
    paper: PaperParams | None
    """Skills that are done as [gibbons] prints them, and their parameters; None is none."""

    def __getitem__(self, skill: Skill[P]) -> P:
        params = self.sections[skill.section]
        assert isinstance(params, skill.params)
        return params


Entry = Program | Skill[Any]
FIRST_OWN_REASON = 100
"""First number of a single skill's own reasons; smaller numbers are shared by all skills."""


class Catalogue(Mapping[str, Entry]):
    """Skills and programs by name, and the tables that the rest of the cell derives from them."""

    def __init__(self, *entries: Entry) -> None:
        """Take the entries and make sure that no two claim the same name, code, stage or section.

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
        """Each skill by the number of its stage."""
        self.stages = {skill.stage: skill.name for skill in skills}
        """Name of each stage by its number."""
        self.counted = tuple(skill.name for skill in skills if skill.counts)
        """Names of the stages whose times make up the total of a run."""
        self.reasons = {reason.value: reason.name for reason in (*Reason, *(reason for reason, _ in own))}
        """Meaning of each number that a run's reason may have."""

    def __getitem__(self, name: str) -> Entry:
        return self._entries[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def in_places(self, times: Mapping[str, float]) -> tuple[float, ...]:
        """Return the times of stages, given by name, s, each at the place of its stage's number; 0 where a stage has no
        time.
        """
        return tuple(times.get(self.stages.get(number, ""), 0.0) for number in range(1, max(self.stages) + 1))

    def require_known(self, record: StageRecord) -> None:
        """Make sure that the line has a number for a stage that ended and for why it ended.

        Raises:
            ConfigError: No skill has that name, or the reason is neither one of every skill's nor in the entry's `reasons`.
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


def _require_distinct(what: str, claims: Iterable[tuple[Any, str]]) -> None:
    owners: dict[Any, str] = {}
    for value, name in claims:
        if value in owners:
            owner = "another entry" if owners[value] == name else owners[value]
            raise ConfigError(f"skill catalogue: {name}: {what} {value} is that of {owner}; a free one allowed")
        owners[value] = name


def _require_sound(skill: Skill[Any]) -> None:
    """Make sure that an entry's own fields agree with each other."""
    if skill.stage < 1:
        raise ConfigError(f"skill catalogue: {skill.name}: stage {skill.stage}: numbers from 1 on allowed")
    for name in skill.steered:
        field = skill.params.model_fields.get(name)
        if field is None or field.annotation is not Gains:
            raise ConfigError(f"skill catalogue: {skill.name}: steered {name!r}: a parameter of type Gains allowed")
    for reason in skill.reasons or ():
        where = f"skill catalogue: {skill.name}: reason {reason.value} {reason.name}"
        if reason.value < FIRST_OWN_REASON:
            raise ConfigError(
                f"{where}: the number is kept for words of every skill; {FIRST_OWN_REASON} or more allowed"
            )
        if reason.name in Reason.__members__:
            raise ConfigError(f"{where}: the word is one of every skill's; a word of its own allowed")
