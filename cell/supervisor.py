"""The scan loop: poll the line, run what it asks for, publish the report. Owns every device, on one thread."""

import logging
import os
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from threading import Event as ThreadEvent
from typing import Protocol

from cell.assembly import Cell, choices, make_estimator, make_tracker
from cell.cell_config import CellConfig
from cell.config import LoadedConfig, with_parameters
from cell.event_log import EventLog, warnings_of
from cell.journal import Journal
from cell.journal_schema import RunRow
from cell.learning import Learning, hole_found
from cell.live import Live, Look
from cell.part_watch import PartWatch
from cell.progress import Progress, progress_of
from cell.record import Ending, RunRecord, StageClock, ending_of
from cell.states import ASKED, Event, State, after, is_permitted, is_reached
from cell.watchdog import LateScans, ScanWatchdog
from drivers.errors import CellError, ConfigError, FaultCode, PlcLostError, ScanOverrunError
from drivers.quantities import ImpedanceSetpoint
from plc_bridge.messages import Command, Control, Refusal, Report, Result
from skills.catalogue import CATALOGUE, RECOVER
from skills.contract import Observation, Outcome, Request
from skills.entry import Claim, Entry
from skills.flow import StageRecord
from skills.scan_guards import RESUME_TIME

logger = logging.getLogger(__name__)

EXIT_BLOCKED = 3
"""Exit status of a program whose skill never comes back: that of a fault."""
_EVENT = {Control[event.name]: event for event in ASKED}


class CommandLine(Protocol):
    """Where commands come from and reports go: the bridge to the PLC, or a technician's terminal."""

    def poll(self) -> Command | None:
        """Return the next command, or None; never waits.

        Raises:
            PlcLostError: Whoever started what is running has fallen silent.
        """

    def publish(self, report: Report) -> None:
        """Make the report readable; never waits."""

    def accept(self, command: Command) -> None:
        """Tell whoever gave a command that it is done: a program begins, a control is obeyed; never waits."""

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Tell whoever gave a command that it is not done, and why; never waits."""


class Supervisor:
    """One cell at work."""

    def __init__(
        self,
        cell: Cell,
        loaded: LoadedConfig,
        line: CommandLine,
        journal: Journal,
        stop: ThreadEvent | None = None,
        live: Live | None = None,
    ) -> None:
        """Take the opened cell, its recipes, the line, the opened journal, what ends `serve`, and the slot for onlookers."""
        self._cell, self._loaded, self._line, self._journal = cell, loaded, line, journal
        self._live = live or Live()
        self._first_seed = cell.config.sim.seed if cell.config.sim is not None else 0
        self._seed, self._stocked = self._first_seed, 0
        self._context = cell.context(self._first_seed)
        self._context.poll, self._context.progress, self._context.record = self._poll, self._progress, self._record
        self._context.ended = self._stage_ended
        self._learning = Learning(journal.folder, loaded.cell.learning)
        self._part = PartWatch(cell, self._context, journal.folder)
        self._events = EventLog(journal, cell.clock.now)
        self._quit = stop or ThreadEvent()
        period, is_simulated = self._context.scan_period, cell.config.sim is not None
        self._watchdog = ScanWatchdog(
            cell.config.scan.longest,
            is_simulated=is_simulated,
            halt=self._say_blocked,
            stop=self._quit,
            give_up=self._end_blocked,
        )
        self._late, self._is_timed = LateScans(period, cell.config.scan), False
        self._request = Request.RUN
        self._since = 0.0
        """Time at which the arm began to be led back after a hold, s."""
        self._run: RunRecord | None = None
        self._done = Progress(())
        self.state = State.IDLE
        self.report = Report(state=State.IDLE)
        self.last: RunRow | None = None
        """The run that ended last, as the journal has it."""

    # One scan.

    def serve(self) -> None:
        """Scan until `quit`; whatever ends it, the arm comes to rest and the record of a run is closed first.

        Raises:
            CellError: The scan itself cannot go on, as with simulated physics that have diverged.
        """
        period, self._is_timed = self._context.scan_period, is_timed(self._cell.config)
        if self._is_timed:
            self._watchdog.start()
        try:
            while not self._quit.is_set():
                started = time.monotonic()
                self.scan()
                # A simulated clock may be faster than the wall; nobody gains by an idle cell that spins.
                self._quit.wait(max(period - (time.monotonic() - started), 0.0))
        except Exception as error:  # the record is closed whatever happened, and the error raised again
            self._abandon(error)
            raise
        finally:
            self._watchdog.stop()
            self._stand()
            self._part.flush()

    def quit(self) -> None:
        """Ask `serve` to end, from any thread or signal handler; what runs is stopped first."""
        self._quit.set()

    @property
    def where_the_peg_is(self) -> str:
        """Place of the peg, the evidence of it, and what to do, as one line."""
        return self._part.told

    def scan(self) -> None:
        """Do one scan outside a program: read every device, take a command, publish, wait for the next scan."""
        clock = self._cell.clock
        started = clock.now()
        self._late.rest()
        fault = _fault_of(self._look)
        if fault is not None:
            self._fault(fault)
        self._publish()
        clock.wait_until(started + self._context.scan_period)

    def _look(self) -> None:
        """Read every device, and act on the commands that wait."""
        if self.state in (State.IDLE, State.COMPLETE):
            seen = self._context.observe()
            self._part.see(seen)
            self._show(seen, 0)
        else:
            self._listen()
            self._part.look()
        self._take_all()

    def _listen(self) -> None:
        """Read what nobody looks at now: what was lost comes back, and what is there stays, only while somebody listens."""
        for device in (self._cell.gripper, self._cell.skin, self._cell.switch):
            with suppress(CellError):
                device.read()

    def _take_all(self) -> None:
        """Act on every command that waits: a start behind an acknowledgement shall not wait for another scan."""
        while (command := self._line.poll()) is not None:
            self._take(command)
            self._publish()

    def _take(self, command: Command) -> None:
        """Act on one command, whatever the state."""
        if command.code not in (Control.LOST, Control.ACKNOWLEDGE):
            self._events.command(command)
        if command.code in CATALOGUE.by_code:
            self._start(command, CATALOGUE.by_code[command.code])
        elif command.code == Control.LOST:
            if self._run is not None and self._request is not Request.STOP:
                raise PlcLostError(
                    f"{command.source}: no sign of life: see plc.life_timeout, on CAN plc.can.plc_timeout"
                )
        elif command.code == Control.ACKNOWLEDGE:
            self._leave_complete()
        elif command.code == Control.FORGET:
            self._forget(command)
        elif command.code in (Control.CLEARED, Control.REFILLED):
            self._note_from_a_person(command)
        elif command.code in _EVENT:
            self._control(command, _EVENT[Control(command.code)])
        else:
            self._refuse(command, Refusal.UNKNOWN_CODE)

    def _control(self, command: Command, event: Event) -> None:
        """Obey a control, or refuse it where the state does not permit it."""
        is_cleared_first = event is Event.RESET and self.state is State.ABORTED
        steps = (Event.CLEAR, event) if is_cleared_first else (event,)
        if is_reached(self.state, event):
            self._line.accept(command)
            return
        if not is_permitted(self.state, steps[0]):
            self._refuse(command, Refusal.NOT_READY)
            return
        for step in steps:
            self._enter(step)
            self._obey(command, step)
        self._line.accept(command)

    def _forget(self, command: Command) -> None:
        """Forget what was learnt of the command's recipe; not while a run learns."""
        if self._run is not None:
            self._refuse(command, Refusal.BUSY)
        elif command.recipe not in self._loaded.recipes:
            self._refuse(command, Refusal.UNKNOWN_RECIPE)
        else:
            self._learning.forget(command.recipe)
            self._line.accept(command)

    def _note_from_a_person(self, command: Command) -> None:
        """Take it that a person, or the line, has taken the peg away or filled the rack; not while a skill moves."""
        if self._run is not None:
            self._refuse(command, Refusal.BUSY)
            return
        if command.code == Control.CLEARED:
            self._part.clear()
        else:
            self._part.refill()
        self._line.accept(command)

    def _obey(self, command: Command, event: Event) -> None:
        """Do what a control asks for, in the state that it led to."""
        if event in (Event.STOP, Event.ABORT):
            self._come_to_rest(Request.STOP)
            if self._run is None:
                self._enter(Event.FINISHED)
        elif event is Event.HOLD:
            self._come_to_rest(Request.HOLD)
        elif event is Event.UNHOLD:
            self._request, self._since = Request.RESUME, self._cell.clock.now()
        else:
            self._rearm(command, event)

    def _rearm(self, command: Command, event: Event) -> None:
        """Make the arm move again after a stop or a fault: CLEAR acknowledges the fault, RESET makes the cell ready."""
        self.report = self._fresh(command, fault=self.report.fault)
        self._cell.arm.reset()
        if event is Event.CLEAR:
            self.report = replace(self.report, fault=FaultCode.NONE)
        else:
            self._context.observe()
        self._enter(Event.FINISHED)
        self.report = replace(self.report, result=Result.SUCCESS)

    def _leave_complete(self) -> None:
        """Be idle again where the last run is complete."""
        if self.state is State.COMPLETE:
            self._enter(Event.RESET)
            self._enter(Event.FINISHED)

    def _refuse(self, command: Command, refusal: Refusal) -> None:
        self._events.refusal(command, refusal)
        self._line.refuse(command, refusal)

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
        refusal = self._part.refusal(entry, config)
        if refusal is not Refusal.NONE:
            self._refuse(command, refusal)
            return
        self._leave_complete()
        self._enter(Event.START)
        self.report = self._fresh(command)
        self._line.accept(command)
        self._publish()
        self._execute(command, entry, config)

    def _execute(self, command: Command, entry: Entry, config: CellConfig) -> None:
        """Run a program to its end, whatever that is; afterwards the cell is in a state that waits."""
        self._request, self._done = Request.RUN, progress_of(entry)
        records: list[StageRecord] = []
        taken, claim = self._cell.clock.now(), entry.claim

        def work() -> None:
            nonlocal claim
            seed = self._first_seed + self._stocked if entry.starts_empty else self._seed
            self._run = RunRecord(self._journal, command, entry.name, config, taken, seed)
            self._events.run = self._run.row.run
            self.report = replace(self.report, run=self._run.row.run)
            self._part.begin(config, entry.claim)
            self._prepare(config)
            self._enter(Event.FINISHED)
            self._watchdog.watch(True)
            if entry.starts_empty and not self._part.is_resolved:
                claim = RECOVER.claim
                records.extend(RECOVER.run(config.skill_set(), self._context))
            if self._part.is_resolved or not entry.starts_empty:
                claim = entry.claim
                self._take_peg(entry, config)
                self._context.job = self._learning.prepared(self._context.job, command.recipe)
                records.extend(entry.run(config.skill_set(), self._context))
            for record in records:
                CATALOGUE.require_known(record)

        fault = _fault_of(work)
        self._watchdog.watch(False)
        fault = self._brought_to_rest(records, fault)
        run, self._run = self._run, None
        ending, fault = self._judged(claim, records, fault, run.clock.stage if run is not None else "")
        self._part.end()
        if run is not None:
            self.report = replace(self.report, hole=hole_found(records) or self.report.hole)
            if ending.outcome is Outcome.SUCCESS:
                self._learning.take(config.job(), command.recipe, records)
            later = _fault_of(partial(self._put_on_record, run, records, ending, fault))
            fault = fault or later
        if fault is None:
            self._settle(ending.outcome)
        else:
            self._fault(fault)
            # Also under sequence 0, which a counter comes to again.
            self.report = replace(self.report, result=Result.FAULT)
        self._events.run = 0

    def _brought_to_rest(self, records: Sequence[StageRecord], fault: CellError | None) -> CellError | None:
        """Bring the arm to rest after a run that did not end as it should; return the first fault."""
        if fault is not None:
            self._enter(Event.ABORT)
            self.report = replace(self.report, fault=fault.code)
        elif ending_of(records, None, "").outcome is Outcome.SUCCESS and self.state is State.EXECUTE:
            self._halt()
            return None
        # Nobody is asked for a sign of life any more: the arm has to come to rest.
        self._request = Request.STOP
        later = _fault_of(self._wait_for_rest)
        if later is not None:
            self._halt()
        return fault or later

    def _judged(
        self, claim: Claim, records: Sequence[StageRecord], fault: CellError | None, stage: str
    ) -> tuple[Ending, CellError | None]:
        """Return how a run ended by the evidence, and the first fault."""
        ending = ending_of(records, fault, stage)
        if fault is not None:
            return ending, fault
        found: list[Ending] = []
        fault = _fault_of(lambda: found.append(self._part.judge(claim, ending, records)))
        return (ending_of(records, fault, stage) if fault is not None else found[0]), fault

    def _wait_for_rest(self) -> None:
        """Bring the arm to rest, and go on telling the line and taking its commands."""

        def meanwhile() -> None:
            self._publish()
            self._listen()
            self._take_all()

        self._context.rest.wait(self._cell.clock, self._context.scan_period, meanwhile)

    def _stand(self) -> None:
        """Bring the arm to rest with nothing else left to do."""
        if _fault_of(partial(self._context.rest.wait, self._cell.clock, self._context.scan_period)) is not None:
            self._halt()

    def _abandon(self, error: Exception) -> None:
        """Close the record of the run under way, and tell the line, where the supervisor itself cannot go on."""
        self._halt()
        fault = error if isinstance(error, CellError) else CellError(f"{type(error).__name__}: {error}")
        run, self._run = self._run, None
        if run is not None:
            ending = ending_of([], fault, run.clock.stage)
            _fault_of(partial(self._put_on_record, run, [], ending, fault))
        _fault_of(partial(self._fault, fault))
        _fault_of(self._publish)

    def _say_blocked(self, why: str) -> None:
        """Halt the arm beside a scan that does not come, and tell who watches; the scan ends the run once it comes."""
        self._halt()
        error = ScanOverrunError(f"{self._context.stage or 'skill'}: {why}")
        logger.error("fault %d: %s", error.code, error)
        self._live.fault = str(error)
        self._line.publish(replace(self.report, state=State.ABORTING, fault=error.code))

    def _end_blocked(self, why: str) -> None:
        """End the program, whose scan never comes again, with the arm halted and the record closed."""
        self._abandon(ScanOverrunError(f"{self._context.stage or 'skill'}: {why}"))
        _fault_of(self._journal.close)
        _fault_of(self._part.flush)
        _fault_of(self._cell.arm.close)
        os._exit(EXIT_BLOCKED)

    def _take_peg(self, entry: Entry, config: CellConfig) -> None:
        """Turn to the next slot of the rack, where the program takes a fresh peg."""
        if not entry.starts_empty:
            return
        ctx = self._context
        self._seed = seed = self._first_seed + self._stocked
        ctx.job, ctx.rng = config.job(slot=self._part.take(config)), choices(seed)
        self._cell.restock(ctx.job, seed)
        self._stocked += 1

    def _prepare(self, config: CellConfig) -> None:
        ctx = self._context
        ctx.job = config.job(slot=ctx.job.slot)
        ctx.limits, ctx.stage, ctx.held = config.limits, "", None
        # A recipe may bring another peg, and a preset another method.
        ctx.estimator, ctx.tracker = make_estimator(config), make_tracker(config)

    def _put_on_record(
        self, run: RunRecord, records: Sequence[StageRecord], ending: Ending, fault: CellError | None
    ) -> None:
        """Tell the journal and the line how a run ended."""
        run.clock.leave(self._cell.clock.now())
        try:
            self.report = self._part.filled(self.report)
            run.finish(ending, fault, records, self._cell.clock.now(), self.report.part)
        finally:
            self.last = run.row
            logger.info("run %d: %s %s %s", run.row.run, run.row.program, ending.outcome, ending.stage)
            self.report = replace(
                _with_times(self.report, run.clock), stage=CATALOGUE.stage_number(ending.stage), reason=ending.reason
            )

    def _settle(self, outcome: Outcome) -> None:
        """Enter the state that follows a run without a fault, and report how it ended."""
        self.report = replace(self.report, result=Result[outcome.name])
        if outcome is Outcome.ABORTED:
            if self.state not in (State.STOPPING, State.ABORTING):
                self._enter(Event.STOP)
        else:
            if self.state is State.HOLDING:
                self._enter(Event.FINISHED)
            if self.state is State.HELD:
                self._enter(Event.UNHOLD)
            if self.state is State.UNHOLDING:
                self._enter(Event.FINISHED)
            self._enter(Event.FINISHED)
            self.report = replace(self.report, progress=100)
        self._enter(Event.FINISHED)

    def _fault(self, error: CellError) -> None:
        """Stop and report; moving again takes a reset."""
        logger.error("fault %d: %s", error.code, error)
        self._live.fault = str(error)
        self._halt()
        self._events.fault(error)
        self._enter(Event.ABORT)
        if self.state is State.ABORTING:
            self._enter(Event.FINISHED)
        result = self.report.result
        if result is Result.NONE and self.report.sequence != 0:
            result = Result.FAULT
        self.report = replace(self.report, result=result, fault=error.code)

    def _come_to_rest(self, request: Request) -> None:
        """Halt the arm, and ask the skill to obey."""
        self._request = request
        self._context.rest.seek(self._cell.clock.now())

    def _halt(self) -> None:
        """Halt the arm, whatever state it is in; one at rest would only sink again by what its model of gravity lacks."""
        if self._context.rest.is_reached:
            return
        try:
            self._cell.arm.halt()
        except CellError as error:
            logger.error("the arm does not take the halt: %s", error)

    # What a program calls at every scan.

    def _poll(self) -> Request:
        run = self._run
        assert run is not None
        self._take_all()
        self._watchdog.beat(self._context.stage)
        if self._is_timed:
            self._late.take(time.monotonic())
        if self._quit.is_set() and self._request is not Request.STOP:
            self._enter(Event.STOP)
            self._come_to_rest(Request.STOP)
        number = CATALOGUE.stage_number(self._context.stage)
        if run.clock.enter(self._context.stage, self._cell.clock.now()):
            self.report = replace(_with_times(self.report, run.clock), stage=number)
        self._publish()
        return self._request

    def _progress(self, fraction: float) -> None:
        percent = self._done.update(self._context.stage, fraction)
        if percent != self.report.progress:
            self.report = replace(self.report, progress=percent)

    def _stage_ended(self, stage: str, elapsed: float) -> None:
        run = self._run
        assert run is not None
        run.clock.end(stage, elapsed)
        self.report = _with_times(self.report, run.clock)

    def _record(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        run = self._run
        assert run is not None
        self._part.see(seen)
        run.add(seen, setpoint, self._cell.sight() if self._cell.sight is not None else None)
        self._show(seen, run.row.run)
        if self.state is State.HOLDING and self._context.rest.is_reached:
            self._enter(Event.FINISHED)
        elif self.state is State.UNHOLDING and seen.stamp - self._since >= RESUME_TIME:
            self._enter(Event.FINISHED)
            self._request = Request.RUN

    def _show(self, seen: Observation, run: int) -> None:
        surface = self._context.job.hole.centre[2]
        self._live.show(Look(seen, self._context.stage if run else "", run, surface))

    # States.

    def _enter(self, event: Event) -> None:
        before, self.state = self.state, after(self.state, event)
        if self.state is before:
            return
        self._events.state(before, self.state)
        if event is not Event.FINISHED:
            self.report = replace(self.report, transition=Control[event.name])

    def _fresh(self, command: Command, fault: int = 0) -> Report:
        before = self.report
        return Report(
            command.sequence, fault=fault, run=before.run, transition=before.transition, warnings=before.warnings
        )

    def _publish(self) -> None:
        self.report = self._part.filled(self.report)
        before, warnings = self.report, warnings_of(self._journal, self._late.is_warned)
        if (before.state, before.warnings, before.overruns) != (self.state, warnings, self._late.count):
            self._events.warned(before.warnings, warnings)
            self.report = replace(before, state=self.state, warnings=warnings, overruns=self._late.count)
        self._line.publish(self.report)


def is_timed(config: CellConfig) -> bool:
    """Tell whether the scan has to keep time with the wall clock: on hardware, and in a simulation in real time."""
    return config.sim is None or config.sim.pace == 1.0


def _with_times(report: Report, clock: StageClock) -> Report:
    return replace(
        report,
        stage_times=CATALOGUE.in_places(clock.times),
        total_time=sum(clock.times.get(name, 0.0) for name in CATALOGUE.counted),
    )


def _fault_of(act: Callable[[], None]) -> CellError | None:
    """Do something, and return what broke, an error inside this program too, as the fault that the line reads."""
    try:
        act()
    except CellError as error:
        return error
    except Exception as error:  # an error inside this program must stop the arm like any other fault
        logger.exception("error inside this program")
        return CellError(f"{type(error).__name__}: {error}".replace("\n", " "))
    return None
