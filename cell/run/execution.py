"""Execution of one program: the run's record, the next peg, the skills, the stop after a fault, and the judged result."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from cell.config.cell_config import CellConfig
from cell.devices.assembly import Cell, choices, make_perception
from cell.peg.ending import Ending, ending_of
from cell.peg.part_watch import PartWatch
from cell.records.journal import Journal
from cell.records.schema import RunRow
from cell.run.arm_watch import ArmWatch
from cell.run.brake import Brake, fault_of
from cell.run.desk import Desk
from cell.run.learning import Learning, hole_found
from cell.run.live import Look
from cell.run.record import RunRecord
from cell.run.states import Event, State
from drivers.errors import CellError
from drivers.quantities import ImpedanceSetpoint
from plc_bridge.protocol.messages import Command, Result
from skills.catalogue import CATALOGUE, RECOVER
from skills.contract import Callbacks, Observation, Outcome, Request, SkillContext
from skills.entry import Claim, Entry, Program
from skills.flow import StageRecord
from skills.guards.scan_guards import RESUME_TIME

logger = logging.getLogger(__name__)


class Execution:
    """Runs the programs of one cell, one at a time, on the scan thread."""

    def __init__(
        self,
        cell: Cell,
        context: SkillContext,
        journal: Journal,
        desk: Desk,
        part: PartWatch,
        brake: Brake,
        *,
        watch: Callable[[bool], None],
        beat: Callable[[], None],
        meanwhile: Callable[[], None],
    ) -> None:
        """Keep the parts of the cell that a program needs.

        Args:
            cell: The opened cell.
            context: The context of its skills.
            journal: The opened journal.
            desk: Keeps state and report.
            part: Watches the peg.
            brake: Brings the arm to rest.
            watch: Function that starts (True) or ends (False) the supervision of a program's scans by the watchdog.
            beat: Function called at the start of each scan of a skill; it takes the waiting commands.
            meanwhile: Function called at each scan while the arm comes to rest after a run.
        """
        self._cell, self._context, self._journal = cell, context, journal
        self._desk, self._part, self._brake = desk, part, brake
        self._watch, self._beat, self._meanwhile = watch, beat, meanwhile
        self._first_seed = cell.config.first_seed
        self._seed, self._stocked = self._first_seed, 0
        self.learning = Learning(journal.folder, cell.config.learning)
        self._arm = ArmWatch(cell.arm_calibration, cell.config.arm_model())
        self._run: RunRecord | None = None
        self.last: RunRow | None = None
        """Journal row of the last run that ended; None before the first."""

    @property
    def is_running(self) -> bool:
        """True if a run is under way."""
        return self._run is not None

    def run(self, command: Command, entry: Entry, config: CellConfig) -> CellError | None:
        """Run a program to its end.

        If no fault occurs, the cell is afterwards in Complete, Stopped or another waiting state.

        Returns:
            First fault of the run, which the caller must report; None if there is none.
        """
        self._brake.request = Request.RUN
        records: list[StageRecord] = []
        taken, claim = self._cell.clock.now(), entry.claim

        def work() -> None:
            nonlocal claim
            self._open(command, entry, config, taken)
            if entry.starts_empty and not self._part.is_resolved:
                claim = RECOVER.claim
                self._go(RECOVER, config, records)
                if records[-1].result.outcome is not Outcome.SUCCESS or not self._part.is_resolved:
                    return
            claim = entry.claim
            self._take_peg(entry, config)
            self._context.job = self.learning.prepared(self._context.job, command.recipe)
            self._go(entry, config, records)

        fault = fault_of(work)
        self._watch(False)
        fault = self._brought_to_rest(records, fault)
        run, self._run = self._run, None
        ending, fault = self._judged(claim, records, fault, run.clock.stage if run is not None else "")
        self._part.end()
        self._desk.misfit = self._arm.end()
        if run is not None:
            self._desk.report = replace(self._desk.report, hole=hole_found(records) or self._desk.report.hole)
            if ending.outcome is Outcome.SUCCESS:
                self.learning.take(config.job(), command.recipe, records)
            fault = self._closed(run, records, ending, fault)
        if fault is None:
            self._settle(ending.outcome)
        return fault

    def abandon(self, fault: CellError) -> None:
        """Close the record of the run under way when the scan cannot continue."""
        run, self._run = self._run, None
        if run is not None:
            self._closed(run, [], ending_of([], fault, run.clock.stage), fault)

    def show(self, seen: Observation) -> None:
        """Publish one scan to the viewers."""
        run, stage = (self._run.row.run, self._context.stage) if self._run is not None else (0, "")
        self._desk.show(Look(seen, stage, run, self._context.job.hole.centre[2]))

    # Beginning.

    def _open(self, command: Command, entry: Entry, config: CellConfig, taken: float) -> None:
        """Open the run's record and set up the context for this config."""
        seed = self._first_seed + self._stocked if entry.starts_empty else self._seed
        self._run = run = RunRecord(self._journal, command, entry, config, taken, seed)
        self._desk.events.run = run.row.run
        self._desk.report = replace(self._desk.report, run=run.row.run)
        self._part.begin(config, entry.claim)
        self._arm.begin()
        ctx = self._context
        ctx.callbacks = Callbacks(
            poll=partial(self._poll, run),
            progress=partial(self._progress, run),
            ended=partial(self._stage_ended, run),
            record=partial(self._record, run),
        )
        ctx.job = config.job(slot=ctx.job.slot)
        ctx.limits, ctx.stage, ctx.lead.held = config.limits, "", None
        # The recipe can change the peg, and the preset can change the method.
        ctx.perception = make_perception(config)
        self._desk.enter(Event.FINISHED)

    def _go(self, entry: Entry, config: CellConfig, records: list[StageRecord]) -> None:
        """Run a program or a skill, and add its stages to `records`. The watchdog's time starts here, after the preparation."""
        self._beat()
        self._watch(True)
        records.extend(entry.run(config.skill_set(), self._context))
        for record in records:
            CATALOGUE.require_known(record)

    def _take_peg(self, entry: Entry, config: CellConfig) -> None:
        """Select the next slot of the rack if the program starts with an empty hand."""
        if not entry.starts_empty:
            return
        ctx = self._context
        self._seed = seed = self._first_seed + self._stocked
        ctx.job, ctx.rng = config.job(slot=self._part.take(config)), choices(seed)
        self._cell.restock(ctx.job, seed)
        self._stocked += 1

    # Ending.

    def _brought_to_rest(self, records: Sequence[StageRecord], fault: CellError | None) -> CellError | None:
        """Bring the arm to rest; after a fault or a run without success, wait until it stands. Return the first fault."""
        if fault is not None:
            self._desk.enter(Event.ABORT)
            self._desk.report = replace(self._desk.report, fault=fault.code)
        elif ending_of(records, None, "").outcome is Outcome.SUCCESS and self._desk.state is State.EXECUTE:
            self._brake.halt()
            return None
        # The PLC watchdog is off from here: the arm must come to rest even without a PLC.
        self._brake.request = Request.STOP
        later = self._brake.wait(self._meanwhile)
        return fault or later

    def _judged(
        self, claim: Claim, records: Sequence[StageRecord], fault: CellError | None, stage: str
    ) -> tuple[Ending, CellError | None]:
        """Judge the run by the evidence; return its ending and the first fault."""
        ending = ending_of(records, fault, stage)
        if fault is not None:
            return ending, fault
        found: list[Ending] = []
        fault = fault_of(lambda: found.append(self._part.judge(claim, ending, records)))
        return (ending_of(records, fault, stage) if fault is not None else found[0]), fault

    def _closed(
        self, run: RunRecord, records: Sequence[StageRecord], ending: Ending, fault: CellError | None
    ) -> CellError | None:
        """Write the run's ending to the journal and the report; return the first fault."""

        def write() -> None:
            self._desk.tell_part()
            run.finish(ending, fault, records, self._cell.clock.now(), self._part.part, self._part.proof)

        run.clock.leave(self._cell.clock.now())
        later = fault_of(write)
        self.last = run.row
        logger.info("run %d: %s %s %s", run.row.run, run.row.program, ending.outcome, ending.stage)
        self._desk.tell_times(run.clock)
        self._desk.report = replace(self._desk.report, stage=CATALOGUE.stage_number(ending.stage), reason=ending.reason)
        return fault or later

    def _settle(self, outcome: Outcome) -> None:
        """Enter the state that follows a run without a fault, and report the result."""
        desk = self._desk
        desk.report = replace(desk.report, result=Result[outcome.name])
        if outcome is Outcome.ABORTED:
            if desk.state not in (State.STOPPING, State.ABORTING):
                desk.enter(Event.STOP)
        else:
            if desk.state is State.HOLDING:
                desk.enter(Event.FINISHED)
            if desk.state is State.HELD:
                desk.enter(Event.UNHOLD)
            if desk.state is State.UNHOLDING:
                desk.enter(Event.FINISHED)
            desk.enter(Event.FINISHED)
            desk.report = replace(desk.report, progress=100)
        desk.enter(Event.FINISHED)

    # Callbacks of the skill context, one call per scan or stage.

    def _poll(self, run: RunRecord) -> Request:
        self._beat()
        if run.clock.enter(self._context.stage, self._cell.clock.now()):
            self._desk.tell_times(run.clock)
            self._desk.report = replace(self._desk.report, stage=CATALOGUE.stage_number(self._context.stage))
        self._desk.publish()
        return self._brake.request

    def _progress(self, run: RunRecord, fraction: float) -> None:
        percent = progress_of(run.entry, self._context.stage, fraction)
        if percent > self._desk.report.progress:
            self._desk.report = replace(self._desk.report, progress=percent)

    def _stage_ended(self, run: RunRecord, stage: str, elapsed: float) -> None:
        run.clock.end(stage, elapsed)
        self._desk.tell_times(run.clock)

    def _record(self, run: RunRecord, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        self._part.see(seen)
        self._arm.see(seen, setpoint)
        run.add(seen, setpoint, self._cell.sight() if self._cell.sight is not None else None)
        self.show(seen)
        if self._desk.state is State.HOLDING and self._brake.is_at_rest:
            self._desk.enter(Event.FINISHED)
        elif self._desk.state is State.UNHOLDING and seen.stamp - self._brake.resumed >= RESUME_TIME:
            self._desk.enter(Event.FINISHED)
            self._brake.request = Request.RUN


def progress_of(entry: Entry, stage: str, fraction: float) -> int:
    """Return the progress of a run, percent, from the completed fraction of its present stage, 0 to 1.

    The stages of a run without failure have equal weight. In any other stage, for example recovery, the progress is 0.
    """
    stages = entry.stages if isinstance(entry, Program) else (entry.name,)
    if stage not in stages:
        return 0
    return int(100.0 * (stages.index(stage) + min(max(fraction, 0.0), 1.0)) / len(stages))
