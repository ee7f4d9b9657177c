"""PackTags, the machine data that PackML requires, collected from the reports; pure, time passed in.

Source of the tags: PackML Unit/Machine Implementation Guide, part 1 (OMAC), chapter on PackTags.
"""

from dataclasses import dataclass

from plc_bridge.protocol.messages import PACKML, TRANSITIONS, Control, Report, Result, entry

STATES = 17
"""Number of PackML states, numbered from 1."""
STOPPED, EXECUTE, STOPPING, ABORTING, ABORTED = 2, 6, 7, 8, 9
"""PackML states with a stop reason, and EXECUTE, which clears the stop reason."""


@dataclass(slots=True)
class PackTags:
    """The tags since the start."""

    unit_mode: int = entry("u16", "PackTags UnitModeCurrent: 1 production", 1)
    state: int = entry("u16", "PackTags StateCurrent, equal to report_state")
    cntrl_cmd: int = entry("u16", f"PackTags CntrlCmd, last control carried out: {TRANSITIONS}")
    stop_reason: int = entry(
        "u16", "PackTags StopReason: fault code, or the control that stopped the cell; 0 from the next EXECUTE on"
    )
    processed: int = entry("u32", "PackTags ProdProcessedCount: insertions that have ended since the start")
    defective: int = entry("u32", "PackTags ProdDefectiveCount: insertions that have ended without success")
    times: list[float] = entry(  # noqa: RUF009  a new list for each instance
        "u32",
        "PackTags StateCumulativeTime: time in state {} since the start",
        lambda: [0.0] * STATES,
        unit="s",
        names=tuple(f"state_time_{number}" for number in range(1, STATES + 1)),
    )
    """Time in each state from 1 on, s."""
    _since: float | None = None

    def obey(self, control: int) -> None:
        """Record a control that the cell has carried out, if PackML defines it."""
        if control in PACKML:
            self.cntrl_cmd = control

    def count(self, result: Result) -> None:
        """Count the end of a run that makes a product."""
        self.processed += 1
        self.defective += result is not Result.SUCCESS

    def record(self, report: Report, now: float) -> None:
        """Take a report of the cell at the time `now`, s."""
        if self._since is not None and 1 <= self.state <= STATES:
            self.times[self.state - 1] += now - self._since
        self.state, self._since = report.state, now
        if report.state == EXECUTE:
            self.stop_reason = 0
        elif report.state in (STOPPED, STOPPING, ABORTING, ABORTED) and report.transition in (
            Control.STOP,
            Control.ABORT,
        ):
            self.stop_reason = report.fault or int(report.transition)
