"""The scan loop: poll the line, run what it asks for, publish the report. Owns every device, on one thread."""

import json
import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from threading import Event as ThreadEvent
from typing import Protocol

from cell.assembly import Cell, choices
from cell.config import CellConfig, LoadedConfig, with_parameters
from cell.journal import Journal, RunRow, config_hash, now_text, versions
from cell.samples import SampleStream
from cell.states import Event, State, after, is_permitted
from cell.statistics import PUBLISHED
from drivers.errors import CellError, ConfigError, FaultCode, PlcLostError
from drivers.quantities import ImpedanceSetpoint
from plc_bridge.messages import Command, Control, Refusal, Report, Result
from skills.catalogue import CATALOGUE, STAGES, Entry
from skills.contract import Observation, Outcome, Reason, Request
from skills.flow import StageRecord

logger = logging.getLogger(__name__)

BY_CODE = {entry.code: entry for entry in CATALOGUE.values()}
COUNTED = tuple(stage.name for stage in PUBLISHED)
"""Stages whose times make up the total, as in [gibbons], Table I."""
STAGE_NUMBER = {"": 0, **{name: number for number, name in enumerate(STAGES, start=1)}}
_RESULT = {Outcome.SUCCESS: Result.SUCCESS, Outcome.FAILURE: Result.FAILURE, Outcome.ABORTED: Result.ABORTED}
_EVENT = {
    Control.STOP: Event.STOP,
    Control.HOLD: Event.HOLD,
    Control.UNHOLD: Event.UNHOLD,
    Control.ABORT: Event.ABORT,
    Control.CLEAR: Event.CLEAR,
    Control.RESET: Event.RESET,
}


class Line(Protocol):
    """Where commands come from and reports go: the bridge to the PLC, or a technician's terminal."""

    def poll(self) -> Command | None:
        """Return the next command, or None; never waits.

        Raises:
            PlcLostError: Whoever started what is running has fallen silent.
        """

    def publish(self, report: Report) -> None:
        """Make the report readable; never waits."""


@dataclass(slots=True)
class Run:
    """The run under way."""

    row: RunRow
    stream: SampleStream
    times: dict[str, float] = field(default_factory=dict)
    """Time in each stage so far, s."""
    stage: str = ""
    since: float = 0.0
    """When that stage began, s."""


class Supervisor:
    """One cell at work."""

    def __init__(
        self, cell: Cell, loaded: LoadedConfig, line: Line, journal: Journal, stop: ThreadEvent | None = None
    ) -> None:
        """Take the opened cell, its recipes, the line, the opened journal, and the event that ends `serve`."""
        self._cell, self._loaded, self._line, self._journal = cell, loaded, line, journal
        self._first_seed = cell.config.sim.seed if cell.config.sim is not None else 0
        self._stocked = 0
        self._context = cell.context(self._first_seed)
        self._context.poll, self._context.progress, self._context.record = self._poll, self._progress, self._record
        self._quit = stop or ThreadEvent()
        self._request = Request.RUN
        self._run: Run | None = None
        self.state = State.IDLE
        self.report = Report(state=State.IDLE)
        self.last: RunRow | None = None
        """The run that ended last, as the journal has it."""

    # One scan.

    def serve(self) -> None:
        """Scan until `quit`, then leave the arm halted."""
        period = self._context.scan_period
        while not self._quit.is_set():
            started = time.monotonic()
            self.scan()
            # A simulated clock may be faster than the wall; nobody gains by an idle cell that spins.
            self._quit.wait(max(period - (time.monotonic() - started), 0.0))
        self._cell.arm.halt()

    def quit(self) -> None:
        """Ask `serve` to end, from any thread or signal handler; what runs is stopped first."""
        self._quit.set()

    def scan(self) -> None:
        """Do one scan outside a program: read every device, take a command, publish, wait for the next scan."""
        clock = self._cell.clock
        started = clock.now()
        try:
            if self.state in (State.IDLE, State.COMPLETE):
                self._context.observe()
            command = self._line.poll()
            if command is not None:
                self._take(command)
        except CellError as error:
            self._fault(error)
        except Exception as error:
            logger.exception("error inside this program")
            self._fault(_as_fault(error))
        self._publish()
        clock.wait_until(started + self._context.scan_period)

    def _take(self, command: Command) -> None:
        """Act on one command, whatever the state."""
        if command.code in BY_CODE:
            self._start(command, BY_CODE[command.code])
        elif command.code == Control.LOST:
            if self._run is not None:
                raise PlcLostError(f"{command.source}: no sign of life for longer than plc.life_timeout")
        elif command.code == Control.ACKNOWLEDGE:
            if self.state is State.COMPLETE:
                self._enter(Event.RESET)
                self._enter(Event.FINISHED)
        elif command.code in _EVENT:
            self._control(command, Control(command.code))
        else:
            self._refuse(command, Refusal.UNKNOWN_CODE)

    def _control(self, command: Command, control: Control) -> None:
        if control is Control.RESET and self.state is State.ABORTED:
            self._control(command, Control.CLEAR)
        if not is_permitted(self.state, _EVENT[control]):
            self._refuse(command, Refusal.NOT_READY)
            return
        self._enter(_EVENT[control])
        is_stop = control in (Control.STOP, Control.ABORT)
        if self._run is None and not is_stop:
            self.report = Report(sequence=command.sequence, fault=self.report.fault, run=self.report.run)
        if control is Control.CLEAR:
            self._cell.arm.reset()
            self.report = replace(self.report, fault=FaultCode.NONE)
            self._enter(Event.FINISHED)
        elif control is Control.RESET:
            self._cell.arm.reset()
            self._context.observe()
            self._enter(Event.FINISHED)
        elif is_stop:
            self._cell.arm.halt()
            self._request = Request.STOP
            if self._run is None:
                self._enter(Event.FINISHED)
        elif control is Control.HOLD:
            self._cell.arm.halt()
            self._request = Request.HOLD
            self._enter(Event.FINISHED)
        elif control is Control.UNHOLD:
            self._request = Request.RUN
            self._enter(Event.FINISHED)
        if self._run is None and not is_stop:
            self.report = replace(self.report, result=Result.SUCCESS)

    def _refuse(self, command: Command, refusal: Refusal) -> None:
        logger.warning(
            "command %d, code %d, from %s refused: %s", command.sequence, command.code, command.source, refusal.name
        )
        if self._run is None:
            self.report = Report(
                sequence=command.sequence,
                result=Result.REFUSED,
                refusal=refusal,
                fault=self.report.fault,
                run=self.report.run,
            )
        else:
            self.report = replace(self.report, refusal=refusal)

    # A run.

    def _start(self, command: Command, entry: Entry) -> None:
        if self._run is not None:
            self._refuse(command, Refusal.BUSY)
            return
        if self.state not in (State.IDLE, State.COMPLETE):
            self._refuse(command, Refusal.NOT_READY)
            return
        base = self._loaded.recipes.get(command.recipe)
        if base is None:
            self._refuse(command, Refusal.UNKNOWN_RECIPE)
            return
        try:
            config = with_parameters(base, command.parameters)
        except ConfigError as error:
            logger.warning("command %d: %s", command.sequence, error)
            self._refuse(command, Refusal.PARAMETER)
            return
        if self.state is State.COMPLETE:
            self._enter(Event.RESET)
            self._enter(Event.FINISHED)
        self._enter(Event.START)
        self.report = Report(sequence=command.sequence, run=self.report.run)
        self._publish()
        self._execute(command, entry, config)

    def _execute(self, command: Command, entry: Entry, config: CellConfig) -> None:
        """Run a program to its end, whatever that is; afterwards the cell is in a state that waits."""
        self._request = Request.RUN
        row = RunRow(
            run=0,
            started=now_text(),
            program=entry.name,
            recipe=command.recipe,
            serial=command.serial,
            source=command.source,
            sequence=command.sequence,
            versions=json.dumps(versions()),
            config_hash=config_hash(config),
        )
        records: list[StageRecord] = []
        fault: CellError | None = None
        try:
            row = self._journal.begin(row)
            self._run = Run(row, self._journal.stream(row.run))
            self.report = replace(self.report, run=row.run)
            self._prepare(entry, config)
            self._enter(Event.FINISHED)
            records = entry.run(config.skill_set(), self._context)
        except CellError as error:
            fault = error
        except Exception as error:
            logger.exception("run %d: error inside this program", row.run)
            fault = _as_fault(error)
        self._cell.arm.halt()
        self._conclude(row, records, fault)

    def _prepare(self, entry: Entry, config: CellConfig) -> None:
        ctx = self._context
        if entry.starts_empty:
            seed = self._first_seed + self._stocked
            ctx.job = config.job(slot=self._stocked % config.rack.slots)
            ctx.rng = choices(seed)
            self._cell.restock(ctx.job, seed)
            self._stocked += 1
        else:
            ctx.job = config.job(slot=ctx.job.slot)
        ctx.limits, ctx.stage, ctx.held = config.limits, "", None

    def _conclude(self, row: RunRow, records: Sequence[StageRecord], fault: CellError | None) -> None:
        """Put the ending on record and enter the state that follows."""
        run, self._run = self._run, None
        if run is not None:
            self._account(run, "")
            run.times.update({record.name: record.result.elapsed for record in records})
            row = replace(run.row, stage_times=json.dumps(list(run.times.items())))
            try:
                run.stream.close()
            except CellError as error:
                fault = fault or error
        ending = next((r for r in records if r.result.outcome is not Outcome.SUCCESS), records[-1] if records else None)
        stage = run.stage if run is not None and ending is None else (ending.name if ending else "")
        reason = ending.result.reason if ending is not None else Reason.NONE
        outcome = "fault" if fault is not None or ending is None else ending.result.outcome.value
        row = replace(
            row,
            outcome=outcome,
            stage=stage,
            reason=reason.name.lower() if reason is not Reason.NONE else "",
            fault=fault.code if fault is not None else FaultCode.NONE,
            message=str(fault or ""),
        )
        try:
            if row.run > 0:
                self._journal.finish(row)
        except CellError as error:
            fault = fault or error
        self.last = row
        logger.info("run %d: %s %s %s %s", row.run, row.program, row.outcome, row.stage, row.reason)
        times = run.times if run is not None else {}
        self.report = replace(
            self.report,
            stage=STAGE_NUMBER[stage],
            reason=reason,
            stage_times=tuple(times.get(name, 0.0) for name in STAGES),
            total_time=sum(times.get(name, 0.0) for name in COUNTED),
        )
        if fault is not None:
            self._fault(fault)
            return
        assert ending is not None
        self.report = replace(self.report, result=_RESULT[ending.result.outcome])
        if ending.result.outcome is Outcome.ABORTED:
            if self.state not in (State.STOPPING, State.ABORTING):
                self._enter(Event.STOP)
        else:
            if self.state is State.HELD:
                self._enter(Event.UNHOLD)
                self._enter(Event.FINISHED)
            self._enter(Event.FINISHED)
            self.report = replace(self.report, progress=100)
        self._enter(Event.FINISHED)

    def _fault(self, error: CellError) -> None:
        """Stop and report; moving again takes a reset."""
        logger.error("fault %d: %s", error.code, error)
        self._cell.arm.halt()
        self._enter(Event.ABORT)
        if self.state is State.ABORTING:
            self._enter(Event.FINISHED)
        result = self.report.result
        if result is Result.NONE and self.report.sequence != 0:
            result = Result.FAULT
        self.report = replace(self.report, result=result, fault=error.code)

    # What a program calls at every scan.

    def _poll(self) -> Request:
        run = self._run
        assert run is not None
        command = self._line.poll()
        if command is not None:
            self._take(command)
        if self._quit.is_set() and self._request is not Request.STOP:
            self._enter(Event.STOP)
            self._request = Request.STOP
        if self._context.stage != run.stage:
            self._account(run, self._context.stage)
        self._publish()
        return self._request

    def _account(self, run: Run, stage: str) -> None:
        """Close the account of the stage that ends, and open that of the next."""
        now = self._cell.clock.now()
        if run.stage:
            run.times[run.stage] = run.times.get(run.stage, 0.0) + now - run.since
        if stage:
            run.stage, run.since = stage, now
            self.report = replace(
                self.report, stage=STAGE_NUMBER[stage], stage_times=tuple(run.times.get(name, 0.0) for name in STAGES)
            )

    def _progress(self, fraction: float) -> None:
        percent = round(100.0 * min(max(fraction, 0.0), 1.0))
        if percent != self.report.progress:
            self.report = replace(self.report, progress=percent)

    def _record(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        run = self._run
        assert run is not None
        run.stream.add(seen, setpoint, STAGE_NUMBER[run.stage])

    # States.

    def _enter(self, event: Event) -> None:
        self.state = after(self.state, event)

    def _publish(self) -> None:
        if self.report.state != self.state:
            self.report = replace(self.report, state=self.state)
        self._line.publish(self.report)


def _as_fault(error: Exception) -> CellError:
    return CellError(f"{type(error).__name__}: {error}".replace("\n", " "))
