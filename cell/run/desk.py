"""A cell's interface to its line, a PLC or a terminal: PackML state, report, answers to commands, and the view for the page."""

import logging
from dataclasses import replace
from typing import Protocol

from cell.peg.part_watch import PartWatch
from cell.records.journal import Journal
from cell.run.event_log import EventLog
from cell.run.live import Live
from cell.run.record import StageClock
from cell.run.states import Event, State, after
from cell.run.watchdog import LateScans
from drivers.errors import CellError
from drivers.protocols import Clock
from plc_bridge.protocol.messages import Command, Control, Refusal, Report, Result, Warnings
from skills.catalogue import CATALOGUE

logger = logging.getLogger(__name__)


class CommandLine(Protocol):
    """Source of commands and reader of reports: the bridge to the PLC, or a technician's terminal."""

    def poll(self) -> Command | None:
        """Return the next command, or None; never waits.

        Raises:
            PlcLostError: The client that started the running program has timed out.
        """

    def publish(self, report: Report) -> None:
        """Make the report readable; never waits."""

    def accept(self, command: Command) -> None:
        """Confirm to the sender of a command that the program starts or the control was executed; never waits."""

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Refuse a command to its sender, with the reason; never waits."""


class Desk:
    """Keeps the state and the report of one cell; for the scan thread."""

    def __init__(
        self, line: CommandLine, live: Live, journal: Journal, clock: Clock, part: PartWatch, late: LateScans
    ) -> None:
        """Start in IDLE. Every report contains the peg's place, warnings of the journal, and the number of late scans."""
        self._line, self._live, self._journal, self._part, self._late = line, live, journal, part, late
        self.poll, self.accept, self.show = line.poll, line.accept, live.show
        self.events = EventLog(journal, clock.now)
        self.misfit = ""
        """Disagreement of the last run's joint torques with the arm's calibration, one line; empty if they agree."""
        self.state = State.IDLE
        self.events.state(None, self.state)
        self.report = Report(state=State.IDLE)

    def enter(self, event: Event) -> None:
        """Make the transition that an event causes in the present state; if there is none, change nothing."""
        before, self.state = self.state, after(self.state, event)
        if self.state is before:
            return
        self.events.state(before, self.state)
        if event is not Event.FINISHED:
            self.report = replace(self.report, transition=Control[event.name])

    def leave_complete(self) -> None:
        """Change from COMPLETE to IDLE; do nothing in any other state."""
        if self.state is State.COMPLETE:
            self.enter(Event.RESET)
            self.enter(Event.FINISHED)

    def open(self, command: Command, run: int = 0) -> None:
        """Start the report on a command; `run` is the number of the command's run, 0 before that is assigned."""
        before = self.report
        self.report = Report(sequence=command.sequence, run=run, transition=before.transition, warnings=before.warnings)

    def tell_times(self, clock: StageClock) -> None:
        """Write the times of the stages into the report."""
        self.report = replace(
            self.report,
            stage_times=CATALOGUE.in_places(clock.times),
            total_time=sum(clock.times.get(name, 0.0) for name in CATALOGUE.counted),
        )

    def tell_part(self) -> None:
        """Write the peg's place and its evidence into the report."""
        self.report = self._part.filled(self.report)
        self._live.evidence = self._part.part.evidence

    def publish(self) -> None:
        """Update the fields that change at every scan, and publish the report on the line."""
        self.tell_part()
        before = self.report
        is_warned = {
            Warnings.NOT_RECORDED: self._journal.trouble,
            Warnings.DISK_LOW: self._journal.is_disk_low,
            Warnings.SCAN_OVERRUNS: self._late.is_warned,
            Warnings.ARM_CALIBRATION: self.misfit,
            Warnings.COMMISSIONING: self._part.commissioning,
        }
        warnings = sum(bit for bit, is_so in is_warned.items() if is_so)
        if (before.state, before.warnings, before.overruns) != (self.state, warnings, self._late.count):
            self.events.warned(before.warnings, warnings, self.misfit)
            self.report = replace(before, state=self.state, warnings=warnings, overruns=self._late.count)
        self._line.publish(self.report)

    def fault(self, error: CellError) -> None:
        """Enter ABORTED and report the fault; the arm moves again only after a reset."""
        self._say(error)
        self.events.fault(error)
        self.enter(Event.ABORT)
        if self.state is State.ABORTING:
            self.enter(Event.FINISHED)
        result = self.report.result
        if result is Result.NONE and self.report.sequence != 0:
            result = Result.FAULT
        self.report = replace(self.report, result=result, fault=error.code)

    def tell_blocked(self, error: CellError) -> None:
        """Publish the fault of a blocked scan, from the watchdog's thread; only the scan thread changes the desk's own report."""
        self._say(error)
        self._line.publish(replace(self.report, state=State.ABORTING, fault=error.code))

    def _say(self, error: CellError) -> None:
        logger.error("fault %d: %s", error.code, error)
        self._live.fault = str(error)

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Refuse a command with a reason."""
        self.events.refusal(command, refusal)
        self._line.refuse(command, refusal)
