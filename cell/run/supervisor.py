"""The scan loop: poll the line, run the requested program, publish the report. One thread owns every device."""

import gc
import logging
import math
import os
import time
from contextlib import suppress
from dataclasses import replace
from threading import Event as ThreadEvent
from threading import Thread, Timer

from cell.config.cell_config import CellConfig
from cell.config.load import LoadedConfig, with_parameters
from cell.devices.assembly import Cell
from cell.peg.part_state import PartState
from cell.peg.part_watch import PartWatch
from cell.records.journal import Journal
from cell.records.schema import RunRow
from cell.run.brake import Brake, fault_of
from cell.run.desk import CommandLine, Desk
from cell.run.execution import Execution
from cell.run.live import Live
from cell.run.states import ASKED, Event, State, is_permitted, is_reached
from cell.run.watchdog import LateScans, ScanWatchdog
from drivers.errors import CellError, ConfigError, FaultCode, PlcLostError, ScanOverrunError
from plc_bridge.protocol.messages import Command, Control, Refusal, Report, Result
from skills.catalogue import CATALOGUE
from skills.contract import Request
from skills.entry import Entry

logger = logging.getLogger(__name__)

ENDING = 5.0
"""Longest time to halt the arm while the scan is blocked, and to halt it and close journal and arm before the program exits, s."""
EXIT_BLOCKED = 3
"""Exit status if a skill never returns; the same as for a fault."""
_EVENT = {Control[event.name]: event for event in ASKED}


class Supervisor:
    """Scan loop and command handling of one cell."""

    def __init__(
        self,
        cell: Cell,
        loaded: LoadedConfig,
        line: CommandLine,
        journal: Journal,
        stop: ThreadEvent | None = None,
        live: Live | None = None,
    ) -> None:
        """Build the supervisor's parts; nothing moves yet.

        Args:
            cell: The opened cell.
            loaded: Config of the cell and its recipes.
            line: Source of commands and reader of reports.
            journal: The opened journal.
            stop: Event that ends `serve`; None for a private one.
            live: Exchange with the page; None for a private one.
        """
        self._cell, self._loaded, self._journal = cell, loaded, journal
        self._context = cell.context(cell.config.first_seed)
        self._late, self._is_timed = LateScans(self._context.schedule.period, cell.config.scan), False
        self._part = PartWatch(cell, self._context, journal.folder)
        self._brake = Brake(cell, self._context)
        self._live = live or Live()
        self._desk = Desk(line, self._live, journal, cell.clock, self._part, self._late)
        self._quit = stop or ThreadEvent()
        self._watchdog = ScanWatchdog(
            cell.config.scan.longest if is_timed(cell.config) else math.inf,
            is_simulated=cell.config.is_simulated,
            halt=self._say_blocked,
            stop=self._quit,
            give_up=self._end_blocked,
        )
        self._execution = Execution(
            cell,
            self._context,
            journal,
            self._desk,
            self._part,
            self._brake,
            watch=self._watchdog.watch,
            beat=self._beat,
            meanwhile=self._meanwhile,
        )

    @property
    def state(self) -> State:
        """State of the cell."""
        return self._desk.state

    @property
    def report(self) -> Report:
        """Current report, as last published or to be published next."""
        return self._desk.report

    @property
    def last(self) -> RunRow | None:
        """Journal row of the last run that ended; None before the first."""
        return self._execution.last

    @property
    def part(self) -> PartState:
        """Last known state of the peg."""
        return self._part.part

    @property
    def misfit(self) -> str:
        """Largest disagreement of the last run's joint torques with the arm's calibration, one line; empty if they agree."""
        return self._desk.misfit

    # The scan outside a program.

    def serve(self) -> None:
        """Scan until `quit`. Before returning or raising, bring the arm to rest and close the record of an open run.

        Raises:
            CellError: The scan cannot continue, for example if the simulated physics have diverged.
        """
        period, self._is_timed = self._context.schedule.period, is_timed(self._cell.config)
        try:
            self._watchdog.start()
            while not self._quit.is_set():
                started = time.monotonic()
                self.scan()
                # A simulated clock can run faster than wall time; the wait keeps an idle cell from using a whole core.
                self._quit.wait(max(period - (time.monotonic() - started), 0.0))
        except BaseException as error:  # close the run's record after any error, then raise it again
            try:
                self._brake.wait(self._watchdog.alive)
            finally:
                self._abandon(error)
            raise
        finally:
            try:
                self._brake.wait(self._watchdog.alive)
            finally:
                self._watchdog.stop()
            self._part.flush()
            self._execution.learning.flush()

    def quit(self) -> None:
        """Request the end of `serve`, from any thread or signal handler; a running program is stopped first."""
        self._quit.set()

    def scan(self) -> None:
        """Do one scan outside a program: read every device, take a command, publish, wait for the next scan."""
        clock = self._cell.clock
        started = clock.now()
        self._late.rest()
        fault = fault_of(self._look)
        if fault is not None:
            self._fault(fault)
            self._watchdog.watch(False)
        self._desk.publish()
        clock.wait_until(started + self._context.schedule.period)

    def _look(self) -> None:
        """Read every device and act on the waiting commands.

        Raises:
            ScanOverrunError: This scan was so late that the watchdog halted the arm.
        """
        self._watchdog.beat("scan")
        if self.state in (State.IDLE, State.COMPLETE):
            seen = self._context.observe()
            self._part.see(seen)
            self._execution.show(seen)
        else:
            self._listen()
            self._part.look()
        self._take_all()

    def _listen(self) -> None:
        """Poll idle devices: their drivers reconnect, and keep their buffers empty, only when read."""
        for device in (self._cell.gripper, self._cell.skin, self._cell.switch):
            with suppress(CellError):
                device.read()

    # The scan inside a program: the execution calls these methods.

    def _beat(self) -> None:
        """Take commands, check the timing and obey `quit` at the start of a skill's scan.

        Raises:
            PlcLostError: The client that started the program has timed out.
            ScanOverrunError: This scan, or too many of the last ones, were late.
        """
        self._take_all()
        self._watchdog.beat(self._context.stage or "skill")
        if self._is_timed:
            self._late.take(time.monotonic())
        if self._quit.is_set() and self._brake.request is not Request.STOP:
            self._desk.enter(Event.STOP)
            self._brake.ask(Request.STOP)

    def _meanwhile(self) -> None:
        """Publish reports and take commands while the arm comes to rest."""
        self._watchdog.alive()
        self._desk.publish()
        self._listen()
        self._take_all()

    def _rehearse(self) -> None:
        """Apply the cable faults requested from the page, in a simulated cell."""
        for pull in self._live.pulls():
            if (device := self._cell.cables.get(pull.cable)) is not None and device.is_unplugged != pull.is_out:
                device.is_unplugged = pull.is_out
                self._live.unplugged ^= {pull.cable}
                self._desk.events.rehearsal(pull)

    # Commands.

    def _take_all(self) -> None:
        """Act on every waiting command: a start behind an acknowledgement must not wait for another scan."""
        self._rehearse()
        while (command := self._desk.poll()) is not None:
            self._take(command)
            self._desk.publish()

    def _take(self, command: Command) -> None:
        """Act on one command, whatever the state."""
        if command.code not in (Control.LOST, Control.ACKNOWLEDGE):
            self._desk.events.command(command)
        if command.code in CATALOGUE.by_code:
            self._start(command, CATALOGUE.by_code[command.code])
        elif command.code == Control.LOST:
            if self._execution.is_running and self._brake.request is not Request.STOP:
                raise PlcLostError(
                    f"{command.source}: no sign of life: see plc.life_timeout, on CAN plc.can.plc_timeout"
                )
        elif command.code == Control.ACKNOWLEDGE:
            self._desk.leave_complete()
        elif command.code in (Control.CLEARED, Control.REFILLED, Control.FORGET):
            self._note(command)
        elif command.code in _EVENT:
            self._control(command, _EVENT[Control(command.code)])
        else:
            self._desk.refuse(command, Refusal.UNKNOWN_CODE)

    def _control(self, command: Command, event: Event) -> None:
        """Execute a control, or refuse it if the state does not permit it."""
        is_cleared_first = event is Event.RESET and self.state is State.ABORTED
        steps = (Event.CLEAR, event) if is_cleared_first else (event,)
        if is_reached(self.state, event):
            self._desk.accept(command)
            return
        if not is_permitted(self.state, steps[0]):
            self._desk.refuse(command, Refusal.NOT_READY)
            return
        for step in steps:
            self._desk.enter(step)
            self._obey(command, step)
        self._desk.accept(command)

    def _note(self, command: Command) -> None:
        """Register that the peg was removed or the rack filled, or forget a recipe's learnt place; refuse during a run."""
        if self._execution.is_running:
            self._desk.refuse(command, Refusal.BUSY)
        elif command.code == Control.FORGET and command.recipe not in self._loaded.recipes:
            self._desk.refuse(command, Refusal.UNKNOWN_RECIPE)
        else:
            if command.code == Control.FORGET:
                self._execution.learning.forget(command.recipe)
            elif command.code == Control.CLEARED:
                self._part.clear()
            else:
                self._part.refill()
            self._desk.accept(command)

    def _obey(self, command: Command, event: Event) -> None:
        """Do the work of a control, in the state that it entered."""
        if event in (Event.STOP, Event.ABORT):
            self._brake.ask(Request.STOP)
            if not self._execution.is_running:
                self._desk.enter(Event.FINISHED)
        elif event is Event.HOLD:
            self._brake.ask(Request.HOLD)
        elif event is Event.UNHOLD:
            self._brake.resume()
        else:
            self._rearm(command, event)

    def _rearm(self, command: Command, event: Event) -> None:
        """Enable the arm after a stop or a fault: CLEAR acknowledges the fault, RESET leads to Idle."""
        desk = self._desk
        desk.open(command, desk.report.run)
        self._cell.arm.reset()
        if event is Event.CLEAR:
            desk.report = replace(desk.report, fault=FaultCode.NONE)
        else:
            self._context.observe()
        desk.enter(Event.FINISHED)
        desk.report = replace(desk.report, result=Result.SUCCESS)

    def _start(self, command: Command, entry: Entry) -> None:
        """Run a program to its end, or refuse it; afterwards the cell is in a waiting state."""
        config = self._config_of(command, entry)
        if isinstance(config, Refusal):
            self._desk.refuse(command, config)
            return
        desk = self._desk
        desk.leave_complete()
        desk.enter(Event.START)
        desk.open(command)
        desk.accept(command)
        desk.publish()
        fault = self._execution.run(command, entry, config)
        if fault is not None:
            self._fault(fault)
            desk.report = replace(desk.report, result=Result.FAULT)
        desk.events.run = 0
        desk.publish()
        gc.collect()  # now, after the answer, so that garbage collection seldom delays a scan of the next run

    def _config_of(self, command: Command, entry: Entry) -> CellConfig | Refusal:
        """Return the config requested by a command, or the reason why the program must not run."""
        if self._execution.is_running:
            return Refusal.BUSY
        if self.state not in (State.IDLE, State.COMPLETE):
            return Refusal.NOT_READY
        base = self._loaded.recipes.get(command.recipe)
        if base is None:
            return Refusal.UNKNOWN_RECIPE
        try:
            config = with_parameters(base, command.parameters)
        except ConfigError as error:
            logger.warning("command %d: %s", command.sequence, error)
            return Refusal.PARAMETER
        refusal = self._part.refusal(entry, config)
        return config if refusal is Refusal.NONE else refusal

    # Faults.

    def _fault(self, error: CellError) -> None:
        """Halt the arm and report the fault; the arm moves again only after a reset."""
        self._brake.halt()
        self._desk.fault(error)

    def _abandon(self, error: BaseException) -> None:
        """Halt the arm, close the run's record and publish the fault when the supervisor cannot continue."""
        self._brake.halt()
        fault = error if isinstance(error, CellError) else CellError(f"{type(error).__name__}: {error}")
        fault_of(lambda: self._execution.abandon(fault))
        fault_of(lambda: self._fault(fault))
        fault_of(self._desk.publish)

    def _say_blocked(self, why: str) -> None:
        """Halt the arm and publish the fault while the scan is blocked; when the scan resumes, it ends the run."""
        # The cause of the hang can also block the halt; the watchdog must go on.
        halt = Thread(target=self._brake.halt, name="halt", daemon=True)
        halt.start()
        halt.join(ENDING)
        self._desk.tell_blocked(self._blocked(why))

    def _end_blocked(self, why: str) -> None:
        """End the program if the scan never resumes: halt the arm, close the record, exit."""
        end = Timer(ENDING, os._exit, (EXIT_BLOCKED,))  # the cause of the hang can also block the halt and the closing
        end.daemon = True
        end.start()
        self._abandon(self._blocked(why))
        fault_of(self._journal.close)
        fault_of(self._part.flush)
        fault_of(self._cell.arm.close)
        end.cancel()
        os._exit(EXIT_BLOCKED)

    def _blocked(self, why: str) -> ScanOverrunError:
        return ScanOverrunError(f"{(self._context.stage or 'skill') if self._execution.is_running else 'scan'}: {why}")


def is_timed(config: CellConfig) -> bool:
    """Return True if the scan must keep wall time: on hardware, and in a simulation at real-time pace."""
    return not config.is_simulated or config.sim is None or config.sim.pace == 1.0
