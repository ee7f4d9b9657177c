"""PackTags, the machine data that PackML requires, collected from the reports; pure, time passed in.

Source of the tags: PackML Unit/Machine Implementation Guide, part 1 (OMAC), chapter on PackTags.
"""

from dataclasses import dataclass, field

from plc_bridge.protocol.images import PACKML, Value
from plc_bridge.protocol.messages import PACKML as CONTROLS_OF_PACKML
from plc_bridge.protocol.messages import Control, Report, Result
from plc_bridge.protocol.registers import STATES

STOPPED, EXECUTE, STOPPING, ABORTING, ABORTED = 2, 6, 7, 8, 9
"""States of PackML with a stop reason, and the state that ends it."""


@dataclass(slots=True)
class PackTags:
    """The tags since the start."""

    state: int = 0
    cntrl_cmd: int = 0
    stop_reason: int = 0
    processed: int = 0
    defective: int = 0
    _times: list[float] = field(default_factory=lambda: [0.0] * STATES)
    _since: float | None = None

    @property
    def times(self) -> tuple[float, ...]:
        """Time in each state from 1 on, s."""
        return tuple(self._times)

    def obey(self, control: int) -> None:
        """Record a control that the cell has carried out, if PackML defines it."""
        if control in CONTROLS_OF_PACKML:
            self.cntrl_cmd = control

    def count(self, result: Result) -> None:
        """Count the end of a run that makes a product."""
        self.processed += 1
        self.defective += result is not Result.SUCCESS

    def record(self, report: Report, now: float) -> None:
        """Take a report of the cell at the time `now`, s."""
        if self._since is not None and 1 <= self.state <= STATES:
            self._times[self.state - 1] += now - self._since
        self.state, self._since = report.state, now
        if report.state == EXECUTE:
            self.stop_reason = 0
        elif report.state in (STOPPED, STOPPING, ABORTING, ABORTED) and report.transition in (
            Control.STOP,
            Control.ABORT,
        ):
            self.stop_reason = report.fault or int(report.transition)

    def words(self) -> list[int]:
        """Return the words of the block."""
        values: dict[str, Value] = {
            # Value of PackML's UnitModeCurrent in this cell.
            "packml_unit_mode": 1,
            "packml_state": self.state,
            "packml_cntrl_cmd": self.cntrl_cmd,
            "packml_stop_reason": self.stop_reason,
            "packml_processed": self.processed,
            "packml_defective": self.defective,
        }
        values.update({f"packml_state_time_{n}": time for n, time in enumerate(self._times, 1)})
        return PACKML.pack(values)
