"""What the cell tells its lines: programs by command code, parameters by number; and the line of a terminal."""

from collections.abc import Callable

from cell.states import State
from plc_bridge.messages import Command, Refusal, Report, Result
from plc_bridge.registers import Parameter
from skills.catalogue import CATALOGUE, STAGES
from skills.contract import Reason

PROGRAMS: dict[int, str] = {entry.code: entry.name for entry in CATALOGUE.values()}

PARAMETERS: tuple[Parameter, ...] = (
    Parameter("grasp.force", "N", 0.1, 1.0, 70.0, "grip force"),
    Parameter("search.speed", "m/s", 1e-4, 0.001, 0.5, "peak speed of the tip while it searches"),
    Parameter("search.timeout", "s", 0.1, 1.0, 600.0, "longest search"),
    Parameter("insert.timeout", "s", 0.1, 1.0, 600.0, "longest insertion"),
    Parameter("adjust.timeout", "s", 0.1, 1.0, 600.0, "longest adjustment"),
)
"""Keys of the config that a command may replace for its own run."""

WORDS: dict[str, dict[int, str]] = {
    "report_state": {state.value: state.name for state in State},
    "report_stage": dict(enumerate(STAGES, 1)),
    "report_reason": {reason.value: reason.name for reason in Reason},
}
"""What the numbers in these registers mean."""


class TerminalLine:
    """A technician's terminal as the only line of a cell: one command, and whoever watches its reports."""

    def __init__(self, command: Command, watch: Callable[[Report], None]) -> None:
        """Take the command to give, once, and who is told of every report."""
        self._command: Command | None = command
        self._watch = watch

    def poll(self) -> Command | None:
        """Return the command the first time."""
        command, self._command = self._command, None
        return command

    def publish(self, report: Report) -> None:
        """Tell whoever watches."""
        self._watch(report)

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Tell whoever watches."""
        self._watch(Report(sequence=command.sequence, result=Result.REFUSED))
