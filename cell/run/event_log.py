"""The events of a cell, as the journal records them."""

import logging
from collections.abc import Callable

from cell.records.journal import Journal
from cell.records.schema import EventKind, EventRow
from cell.records.wall_clock import now_text
from cell.run.live import CablePull
from cell.run.states import State
from drivers.errors import CellError, JournalError
from plc_bridge.protocol.messages import Command, Control, Refusal, Warnings
from skills.catalogue import CATALOGUE

logger = logging.getLogger(__name__)


class EventLog:
    """Records the events of one cell."""

    def __init__(self, journal: Journal, now: Callable[[], float]) -> None:
        """Keep the journal and the function that returns the cell's time, s."""
        self._journal, self._now = journal, now
        self.run = 0
        """Number of the present run; 0 for none."""

    def state(self, before: State | None, after: State) -> None:
        """Record a change of state; `before` is None at the start of the cell."""
        self._note(EventKind.STATE, after.name, code=after, text=before.name if before else "")

    def command(self, command: Command) -> None:
        """Record a command and its source."""
        self._note(EventKind.COMMAND, name_of(command.code), command.code, command)

    def refusal(self, command: Command, refusal: Refusal) -> None:
        """Record the refusal of a command, with the reason."""
        self._note(EventKind.REFUSAL, refusal.name.lower(), refusal, command, name_of(command.code))

    def fault(self, error: CellError) -> None:
        """Record a fault."""
        self._note(EventKind.FAULT, error.code.name, error.code, text=str(error))

    def warned(self, before: int, now: int, misfit: str) -> None:
        """Record new and cleared warnings; `before` and `now` are sums of `Warnings`, `misfit` is the text of the arm's warning."""
        texts = {Warnings.NOT_RECORDED: self._journal.trouble, Warnings.ARM_CALIBRATION: misfit}
        for bit, name in WARNINGS.items():
            if (before ^ now) & bit:
                text = texts.get(bit, "") if now & bit else ""
                self._note(EventKind.WARNING, name if now & bit else f"{name} is over", text=text)

    def rehearsal(self, pull: CablePull) -> None:
        """Record that a viewer unplugged or plugged in a cable of a simulated cell."""
        self._note(EventKind.REHEARSAL, f"{pull.cable} {'unplugged' if pull.is_out else 'plugged in'}", by=pull.source)

    def _note(
        self,
        kind: EventKind,
        name: str,
        code: int = 0,
        command: Command | None = None,
        text: str = "",
        by: str = "",
    ) -> None:
        source, sequence = (by, 0) if command is None else (command.source, command.sequence)
        row = EventRow(0, now_text(), self._now(), kind, name, int(code), source, sequence, self.run, text)
        try:
            self._journal.writer.note(row)
        except JournalError as error:
            logger.warning("not on record: %s %s: %s", kind, name, error)


WARNINGS = {
    Warnings.NOT_RECORDED: "not recorded",
    Warnings.DISK_LOW: "disk low",
    Warnings.SCAN_OVERRUNS: "scan overruns",
    Warnings.ARM_CALIBRATION: "arm calibration",
    Warnings.COMMISSIONING: "commissioning",
}
"""Name of each warning."""


def name_of(code: int) -> str:
    """Return the name of a command code, in lower case; the number if the code is unknown."""
    if code in CATALOGUE.by_code:
        return CATALOGUE.by_code[code].name
    try:
        return Control(code).name.lower()
    except ValueError:
        return str(code)
