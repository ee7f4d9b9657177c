"""The record of a run: times by stage, samples at every scan, and the row of its end."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from cell.config.cell_config import CellConfig
from cell.peg.ending import Ending
from cell.peg.part_state import PartState
from cell.records.journal import Journal
from cell.records.provenance import config_text, digest_of, versions
from cell.records.run_trace import RunTrace
from cell.records.sample_blocks import SampleStream
from cell.records.schema import ConfigRow, RunRow
from cell.records.wall_clock import now_text
from drivers.errors import CellError, FaultCode
from drivers.quantities import ImpedanceSetpoint
from drivers.scene_facts import SceneFacts, Sight
from plc_bridge.protocol.messages import Command
from skills.catalogue import CATALOGUE
from skills.contract import Observation
from skills.entry import Entry
from skills.flow import StageRecord


@dataclass(slots=True)
class StageClock:
    """Measures the time of each stage during a run."""

    times: dict[str, float] = field(default_factory=dict)
    """Time of each ended stage, all its tries together, s; never decreases."""
    stage: str = ""
    """Present stage, or the last one."""
    _since: float | None = None
    """Start of the present stage, s; None between two stages."""

    def enter(self, stage: str, now: float) -> bool:
        """Register the present stage at the time `now`, s; return True if it starts now."""
        if stage == self.stage and self._since is not None:
            return False
        self.leave(now)
        self.stage, self._since = stage, now
        return True

    def end(self, stage: str, elapsed: float) -> None:
        """End a stage and add the time that it counted, s; a skill may exclude the transfer to its place."""
        self.times[stage] = self.times.get(stage, 0.0) + elapsed
        self._since = None

    def leave(self, now: float) -> None:
        """End the present stage if it has not ended itself, and count all of its time."""
        if self._since is not None:
            self.end(self.stage, now - self._since)


def scene_facts(config: CellConfig) -> SceneFacts:
    """Return the facts of the scene for pictures of a run with this config."""
    return SceneFacts(arm=config.arm_model(), job=config.job(), layout=config.skin.layout)


class RunRecord:
    """The record of the present run."""

    def __init__(
        self, journal: Journal, command: Command, entry: Entry, config: CellConfig, now: float, seed: int
    ) -> None:
        """Record the start of the run before anything moves; the journal's own thread writes it.

        Args:
            journal: The opened journal.
            command: The command that started the run.
            entry: The program or the skill.
            config: Config of the run, its parameters included.
            now: Time of the command on the cell's clock, s.
            seed: Seed of the simulated world's draws and of the skills' choices in this run.

        Raises:
            JournalError: The journal is not open.
        """
        self._records = journal.writer
        self.entry, self.clock = entry, StageClock()
        self._trace, self._scans = RunTrace(now, config.job().hole), 0
        text = config_text(config)
        self.row = self._records.begin(
            RunRow(
                run=0,
                started=now_text(),
                program=entry.name,
                recipe=command.recipe,
                serial=command.serial,
                source=command.source,
                sequence=command.sequence,
                versions=json.dumps(versions()),
                config_hash=digest_of(text),
                parameters=json.dumps(dict(command.parameters)),
                is_simulated=int(config.is_simulated),
                seed=seed,
            ),
            scene_facts(config),
        )
        self._records.keep_config(ConfigRow(self.row.config_hash, text))
        self._stream = SampleStream(partial(self._records.write, self.row.run))

    def add(self, seen: Observation, setpoint: ImpedanceSetpoint | None, sight: Sight | None = None) -> None:
        """Record one scan; in a simulated cell, `sight` holds the true poses of peg and hole."""
        self._scans += 1
        self._trace.see(seen, self.clock.stage)
        self._stream.add(seen, setpoint, CATALOGUE.stage_number(self.clock.stage), sight)

    def finish(
        self,
        ending: Ending,
        fault: CellError | None,
        records: Sequence[StageRecord],
        now: float,
        part: PartState,
        proof: str = "",
    ) -> None:
        """Record the end of the run.

        Args:
            ending: Ending of the run.
            fault: First fault of the run; None without one.
            records: Stages of the run.
            now: Time of the end on the cell's clock, s.
            part: State of the peg at the end.
            proof: Evidence that proved a success, in words; empty without one.
        """
        self.row = self._trace.figures(
            replace(
                self.row,
                outcome=ending.outcome,
                stage=ending.stage,
                reason=ending.word,
                fault=fault.code if fault is not None else FaultCode.NONE,
                message=str(fault or ""),
                stage_times=json.dumps(list(self.clock.times.items())),
                ended=now_text(),
                cycle_time=now - self._trace.began,
                retries=sum(record.retried for record in records),
                part=part.place.name.lower(),
                part_evidence=part.evidence,
                proof=proof,
                samples=self._scans,
            )
        )
        self._records.finish(self.row, self._trace.stages(self.row.run, records, fault), self._stream.rest())
