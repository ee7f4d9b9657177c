"""Programs and controls by command code, for every line of a cell; and the line of a terminal."""

from collections.abc import Callable

from cell.run.states import ASKED, State
from drivers.errors import ConfigError
from plc_bridge.protocol.messages import FIRST_PROGRAM, Command, Control, Refusal, Report, Result
from plc_bridge.protocol.registers import STAGES
from skills.catalogue import CATALOGUE
from skills.entry import Catalogue

PROGRAMS: dict[int, str] = {code: entry.name for code, entry in CATALOGUE.by_code.items()}

TOLD: dict[str, Control] = {control.name.lower(): control for control in (Control.CLEARED, Control.REFILLED)}
"""Controls with which a person confirms an action at the peg or the rack."""
CONTROLS: dict[str, Control] = {**{event.value: Control[event.name] for event in ASKED}, **TOLD}
"""Controls that can be requested from a running cell, in addition to programs and skills."""

WORDS: dict[str, dict[int, str]] = {
    "report_state": {state.value: state.name for state in State},
    "report_stage": dict(CATALOGUE.stages),
    "report_reason": dict(CATALOGUE.reasons),
}
"""Meaning of each value, by name of the register."""


def _require_fits(catalogue: Catalogue) -> None:
    """Require that names and codes of the catalogue fit the PLC's map and the terminal without conflicts.

    Raises:
        ConfigError: One line with the entry, the value found and the permitted values.
    """
    for name, entry in catalogue.items():
        if not FIRST_PROGRAM <= entry.code < Control.LOST:
            raise ConfigError(
                f"skill catalogue: {name}: command code {entry.code}: {FIRST_PROGRAM} to {Control.LOST - 1} allowed"
            )
        if name in CONTROLS:
            raise ConfigError(
                f"skill catalogue: {name}: the name of a control; another than {', '.join(CONTROLS)} allowed"
            )
    for number, name in catalogue.stages.items():
        if number > STAGES:
            raise ConfigError(
                f"skill catalogue: {name}: stage {number}: the PLC's map holds {STAGES}; 1 to {STAGES} allowed"
            )


_require_fits(CATALOGUE)


class TerminalLine:
    """A technician's terminal as the only line of a cell: it issues one command and passes all reports to a function."""

    def __init__(self, command: Command, watch: Callable[[Report], None]) -> None:
        """Store the command to issue, and the function to call with every report."""
        self._command: Command | None = command
        self._watch, self._has_scanned = watch, False
        self.refusal = Refusal.NONE
        """Reason of the refusal; NONE without one."""

    def poll(self) -> Command | None:
        """Return the command once, after the first scan; that scan loads compiled functions, so that no run waits for them."""
        if not self._has_scanned:
            return None
        command, self._command = self._command, None
        return command

    def publish(self, report: Report) -> None:
        """Call the function with the report."""
        self._has_scanned = True
        self._watch(report)

    def accept(self, command: Command) -> None:
        """Call the function with the result of a control; for a program, the reports contain it."""
        if command.code < FIRST_PROGRAM:
            self._watch(Report(sequence=command.sequence, result=Result.SUCCESS))

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Keep the refusal and call the function."""
        self.refusal = refusal
        self._watch(Report(sequence=command.sequence, result=Result.REFUSED))
