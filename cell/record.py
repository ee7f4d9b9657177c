"""How a run goes on record: times by stage, samples at every scan, and the row that says how it ended."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum

from cell.config import CellConfig
from cell.journal import Journal, RunRow, config_hash, now_text, versions
from cell.samples import SampleStream
from drivers.errors import CellError, FaultCode
from drivers.quantities import ImpedanceSetpoint
from drivers.scene_facts import SceneFacts, Sight
from plc_bridge.messages import Command
from skills.catalogue import CATALOGUE
from skills.contract import Observation, Outcome, Reason
from skills.flow import StageRecord


@dataclass(slots=True)
class StageClock:
    """Keeps the time of each stage of a run while it lasts."""

    times: dict[str, float] = field(default_factory=dict)
    """Of the stages so far, s; the way to a stage's place counts until the stage itself says better."""
    stage: str = ""
    """The one under way or reached last."""
    _since: float = 0.0

    def enter(self, stage: str, now: float) -> bool:
        """Note which stage is under way at the time `now`, s; return whether that is another one than before."""
        if stage == self.stage:
            return False
        self.leave(now)
        self.stage, self._since = stage, now
        return True

    def leave(self, now: float) -> None:
        """Close the account of the stage under way; it may be entered again."""
        if self.stage:
            self.times[self.stage] = self.times.get(self.stage, 0.0) + now - self._since
            self._since = now

    def settle(self, records: Sequence[StageRecord]) -> None:
        """Take the time that each stage counts as its own, all its tries together."""
        self.times.update({record.name: 0.0 for record in records})
        for record in records:
            self.times[record.name] += record.result.elapsed


@dataclass(frozen=True, slots=True)
class Ending:
    """How a run ended."""

    outcome: Outcome
    stage: str
    """That did not succeed, or the last one."""
    reason: IntEnum
    """A `Reason`, or one of the skill's own."""

    @property
    def word(self) -> str:
        """The reason as records have it; empty where there is none."""
        return "" if self.reason is Reason.NONE else self.reason.name.lower()


def ending_of(records: Sequence[StageRecord], fault: CellError | None, stage: str) -> Ending:
    """Return how a run ended: by its first stage that did not succeed and was not tried again, or by a fault in `stage`."""
    if fault is not None or not records:
        return Ending(Outcome.FAULT, stage, Reason.NONE)
    last = next(
        (record for record in records if record.result.outcome is not Outcome.SUCCESS and not record.retried),
        records[-1],
    )
    return Ending(last.result.outcome, last.name, last.result.reason)


def scene_facts(config: CellConfig) -> SceneFacts:
    """Return what a picture of a run with this config has to know."""
    return SceneFacts(arm=config.arm_model(), job=config.job(), layout=config.skin.layout)


class RunRecord:
    """The record of the run under way."""

    def __init__(self, journal: Journal, command: Command, program: str, config: CellConfig) -> None:
        """Put the run on record before it moves anything.

        Raises:
            JournalError: The journal cannot be written.
        """
        self._journal = journal
        self.clock = StageClock()
        self.row = journal.begin(
            RunRow(
                run=0,
                started=now_text(),
                program=program,
                recipe=command.recipe,
                serial=command.serial,
                source=command.source,
                sequence=command.sequence,
                versions=json.dumps(versions()),
                config_hash=config_hash(config),
            )
        )
        self._stream: SampleStream = journal.stream(self.row.run, scene_facts(config))

    def add(self, seen: Observation, setpoint: ImpedanceSetpoint | None, sight: Sight | None = None) -> None:
        """Record one scan, in a simulated cell with where peg and hole really are.

        Raises:
            JournalError: The samples cannot be written.
        """
        self._stream.add(seen, setpoint, CATALOGUE.stage_number(self.clock.stage), sight)

    def finish(self, ending: Ending, fault: CellError | None) -> None:
        """Put on record how the run ended.

        Raises:
            JournalError: The journal cannot be written.
        """
        self.row = replace(
            self.row,
            outcome=ending.outcome,
            stage=ending.stage,
            reason=ending.word,
            fault=fault.code if fault is not None else FaultCode.NONE,
            message=str(fault or ""),
            stage_times=json.dumps(list(self.clock.times.items())),
        )
        try:
            self._stream.close()
        finally:
            self._journal.finish(self.row)
