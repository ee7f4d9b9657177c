"""The cell's side of its lines: programs by command code, parameters by number; and the line of a terminal."""

from collections.abc import Callable

from cell.states import ASKED, State
from drivers.errors import ConfigError
from plc_bridge.messages import FIRST_PROGRAM, Command, Control, Refusal, Report, Result
from plc_bridge.registers import STAGES, Parameter
from skills.catalogue import CATALOGUE
from skills.entry import Catalogue

PROGRAMS: dict[int, str] = {code: entry.name for code, entry in CATALOGUE.by_code.items()}

PARAMETERS: tuple[Parameter, ...] = (
    Parameter("grasp.force", "N", 0.1, 1.0, 70.0, "grip force"),
    Parameter("search.speed", "m/s", 1e-4, 0.001, 0.5, "peak speed of the tip while it searches"),
    Parameter("search.timeout", "s", 0.1, 1.0, 600.0, "longest search"),
    Parameter("insert.timeout", "s", 0.1, 1.0, 600.0, "longest insertion"),
    Parameter("adjust.timeout", "s", 0.1, 1.0, 600.0, "longest adjustment"),
)
"""Keys of the config that a command may replace for its own run."""

TOLD: dict[str, Control] = {control.name.lower(): control for control in (Control.CLEARED, Control.REFILLED)}
"""What a person tells a cell, running or not, of the peg and the rack."""
CONTROLS: dict[str, Control] = {**{event.value: Control[event.name] for event in ASKED}, **TOLD}
"""Controls that can be asked of a running cell beside programs and skills."""

WORDS: dict[str, dict[int, str]] = {
    "report_state": {state.value: state.name for state in State},
    "report_stage": dict(CATALOGUE.stages),
    "report_reason": dict(CATALOGUE.reasons),
}
"""Meaning of the numbers in these registers."""


def _require_fits(catalogue: Catalogue) -> None:
    """Make sure that the PLC's map and the terminal can tell all entries of the catalogue apart.

    Raises:
        ConfigError: One line that names the entry, what it claims and what is allowed.
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
    """A technician's terminal as the only line of a cell: it gives one command, and reports are shown to whoever watches."""

    def __init__(self, command: Command, watch: Callable[[Report], None]) -> None:
        """Take the command, which is given once, and the function that is called with every report."""
        self._command: Command | None = command
        self._watch = watch
        self.refusal = Refusal.NONE
        """Why the command was refused."""

    def poll(self) -> Command | None:
        """Return the command the first time."""
        command, self._command = self._command, None
        return command

    def publish(self, report: Report) -> None:
        """Pass the report to the watcher."""
        self._watch(report)

    def accept(self, command: Command) -> None:
        """Tell the watcher of a control; of a program the reports tell."""
        if command.code < FIRST_PROGRAM:
            self._watch(Report(sequence=command.sequence, result=Result.SUCCESS))

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Tell the watcher."""
        self.refusal = refusal
        self._watch(Report(sequence=command.sequence, result=Result.REFUSED))
