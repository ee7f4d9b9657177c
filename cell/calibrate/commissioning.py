"""Commissioning with the real PLC: the requested steps, and the measurement of each step.

The cell is served during commissioning. A step ends when the cell has measured the requested action, or at its timeout;
no step relies on a confirmation by a technician.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from threading import Event

from cell.run.states import State
from plc_bridge.bridge import Bridge
from plc_bridge.protocol.messages import FIRST_PROGRAM, Command, Control, Report, Result
from plc_bridge.protocol.registers import VERSION_MAJOR, VERSION_MINOR
from plc_bridge.protocol.watchdog import PlcSight
from skills.catalogue import CATALOGUE

MOTION = CATALOGUE["recover"].code
"""Command code of a motion that needs no part."""
STOPPED = (State.STOPPED, State.ABORTED)
"""States of a cell that has stopped."""


@dataclass(frozen=True, slots=True)
class CellSighting:
    """View of the cell in one scan."""

    time: float
    """Monotonic time of this computer, s."""
    plc: PlcSight | None
    """View of the PLC; None while it is not connected."""
    holder: str
    """Name of the link that holds the lease; empty when it is free."""
    report: Report
    command: Command | None = None
    """Command taken from the line in this scan."""


@dataclass(frozen=True, slots=True)
class Finding:
    """Result of one step."""

    step: str
    passed: bool
    measured: str


Look = Callable[["Memory", CellSighting], str | None]
"""Function that returns the measurement when the requested action has happened, else None; it can raise `StepFailedError`."""


@dataclass(slots=True)
class Memory:
    """Memory of the present step."""

    began: CellSighting
    at: dict[str, float] = field(default_factory=dict)
    """Monotonic time of the first observation of each event, s, by name of the event."""
    run: Command | None = None


@dataclass(frozen=True, slots=True)
class Step:
    """One step."""

    name: str
    asks: str
    """Request to the technician: the action of the PLC."""
    look: Look


class StepFailedError(Exception):
    """The action of the PLC was not the requested one."""


@dataclass(slots=True)
class Walk:
    """The sequence of all steps.

    Args:
        host: Address, node or line of the PLC.
        life_timeout: Timeout of the PLC's life counter, s.
        patience: Longest time for one step, s.
        ask: Function called with the request to the technician at the start of each step.
    """

    host: str
    life_timeout: float
    patience: float
    ask: Callable[[str], object]
    findings: list[Finding] = field(default_factory=list)
    _memory: Memory | None = None

    def steps(self) -> Sequence[Step]:
        """Return every step in order."""
        reset = partial(_answered, (Control.RESET,), (State.IDLE,))
        return (
            Step("connection", f"let the PLC at {self.host} connect and write its command block", _connected),
            Step("life counter", "let the PLC cycle as in production", self._life),
            Step("stop", "stop the cell from the PLC", partial(_answered, (Control.STOP, Control.ABORT), STOPPED)),
            Step("reset", "reset the cell from the PLC", reset),
            Step("lease", "let the PLC take the lease (command_lease 1)", self._lease),
            Step("motion", f"with no part in the hand, start code {MOTION} from the PLC", _moved),
            Step("result", "let the PLC acknowledge the result", _acknowledged),
            Step("loss", f"start code {MOTION} again, HOLD it, then switch the PLC off or pull its cable", _lost),
            Step("return", "switch the PLC on again and reset the cell from it", reset),
        )

    @property
    def is_over(self) -> bool:
        """True if all steps have passed, or one has failed."""
        return len(self.findings) == len(self.steps()) or any(not each.passed for each in self.findings)

    def look(self, now: CellSighting) -> None:
        """Evaluate one scan of the cell."""
        if self.is_over:
            return
        step = self.steps()[len(self.findings)]
        if self._memory is None:
            self._memory = Memory(now)
            self.ask(f"{len(self.findings) + 1}/{len(self.steps())} {step.name}: {step.asks}")
        try:
            measured = step.look(self._memory, now)
        except StepFailedError as error:
            self._end(Finding(step.name, False, str(error)))
            return
        if measured is not None:
            self._end(Finding(step.name, True, measured))
        elif now.time - self._memory.began.time > self.patience:
            self._end(Finding(step.name, False, f"not seen within {self.patience:g} s"))

    def _end(self, finding: Finding) -> None:
        self.findings.append(finding)
        self._memory = None
        self.ask(f"    {'passed' if finding.passed else 'FAILED'}: {finding.measured}")

    def _life(self, memory: Memory, now: CellSighting) -> str | None:
        before = memory.began.plc
        if now.plc is None or before is None:
            return None
        count = now.plc.life_changes - before.life_changes
        # Number of changes of the life counter that the step requires.
        if count < 50:
            return None
        said = f"{count} changes, {1000 * (now.time - memory.began.time) / count:.1f} ms each"
        said += f", longest gap {1000 * now.plc.longest_gap:.0f} ms of {1000 * self.life_timeout:.0f}"
        # Largest gap between two changes of the life counter, fraction of `plc.life_timeout`.
        if now.plc.longest_gap > 0.5 * self.life_timeout:
            raise StepFailedError(f"{said}: half of plc.life_timeout allowed")
        return said + ("" if now.plc.uses_tail else "; command_life_tail not written: torn blocks are not detected")

    def _lease(self, memory: Memory, now: CellSighting) -> str | None:
        holder = now.holder.rpartition("@")[2]
        if not holder:
            return None
        if holder != self.host and holder.rpartition(":")[0] != self.host:
            raise StepFailedError(f"{now.holder} holds the lease; {self.host} expected")
        return f"held by {now.holder}"


def _connected(memory: Memory, now: CellSighting) -> str | None:
    if now.plc is None:
        return None
    if not now.plc.version:
        return f"{now.plc.source}, which reports no map version"
    major, minor = divmod(now.plc.version, 0x100)
    if major != VERSION_MAJOR:
        raise StepFailedError(f"{now.plc.source} has map {major}.{minor}; {VERSION_MAJOR}.x allowed")
    return f"{now.plc.source}, map {major}.{minor}"


def _answered(controls: Sequence[Control], states: Sequence[State], memory: Memory, now: CellSighting) -> str | None:
    """Return the delay from one of the controls to one of the states; None before that."""
    if now.command is not None and now.command.code in controls:
        memory.at.setdefault("command", now.time)
    if "command" not in memory.at or now.report.state not in states:
        return None
    return f"{State(now.report.state).name} {1000 * (now.time - memory.at['command']):.1f} ms after the scan that read the command"


def _moved(memory: Memory, now: CellSighting) -> str | None:
    _begin(memory, now)
    if memory.run is None or now.report.sequence != memory.run.sequence or now.report.result is Result.NONE:
        return None
    if now.report.result is not Result.SUCCESS:
        raise StepFailedError(f"run {now.report.run} ended in {Result(now.report.result).name}")
    return f"run {now.report.run}, {now.time - memory.at['run']:.1f} s"


def _begin(memory: Memory, now: CellSighting) -> None:
    """Store the run that the PLC starts; any program other than the motion without a part is a failure."""
    if now.command is None or not FIRST_PROGRAM <= now.command.code < Control.LOST:
        return
    if now.command.code != MOTION:
        raise StepFailedError(f"code {now.command.code} was started; {MOTION} allowed")
    memory.run = now.command
    memory.at.setdefault("run", now.time)


def _acknowledged(memory: Memory, now: CellSighting) -> str | None:
    if now.report.state == State.IDLE:
        return f"{1000 * (now.time - memory.began.time):.0f} ms after the result"
    return None


def _lost(memory: Memory, now: CellSighting) -> str | None:
    _begin(memory, now)
    if now.plc is not None:
        memory.at["heard"] = now.time - now.plc.silence
    if now.command is not None and now.command.code == Control.LOST:
        memory.at.setdefault("lost", now.time)
    if "lost" not in memory.at or now.report.state not in STOPPED:
        return None
    silence = now.time - memory.at.get("heard", memory.began.time)
    return f"{State(now.report.state).name} {1000 * silence:.0f} ms after the last sign of life"


class WatchedLine:
    """The bridge as the line of a cell; commissioning evaluates every scan."""

    def __init__(self, bridge: Bridge, walk: Walk, stop: Event) -> None:
        """Keep the bridge, the steps, and the event that ends the service after the last step."""
        self._bridge, self._walk, self._stop = bridge, walk, stop
        self._is_watching = False
        self._report = Report()
        self.accept, self.refuse = bridge.accept, bridge.refuse

    def begin(self) -> None:
        """Start the first step."""
        self._is_watching = True

    def poll(self) -> Command | None:
        """Return the bridge's next command, and evaluate it."""
        command = self._bridge.poll()
        if command is not None:
            self._look(self._report, command)
        return command

    def publish(self, report: Report) -> None:
        """Publish the report on the bridge, and evaluate it."""
        self._report = report
        self._bridge.publish(report)
        self._look(report)

    def _look(self, report: Report, command: Command | None = None) -> None:
        if not self._is_watching:
            return
        bridge, walk = self._bridge, self._walk
        walk.look(CellSighting(time.monotonic(), bridge.sight(walk.host), bridge.holder, report, command))
        if walk.is_over:
            self._stop.set()


def record(walk: Walk, name: str, date: str, version: str) -> dict[str, object]:
    """Return the record of commissioning, for printing and signature.

    Args:
        walk: The steps with their results.
        name: Name of the person who commissioned.
        date: Date, ISO 8601.
        version: Version of this program.
    """
    return {
        "what": "commissioning of cell and PLC",
        "date": date,
        "technician": name,
        "plc": walk.host,
        "version": version,
        "map": f"{VERSION_MAJOR}.{VERSION_MINOR}",
        "passed": len(walk.findings) == len(walk.steps()) and all(each.passed for each in walk.findings),
        "steps": [{"step": each.step, "passed": each.passed, "measured": each.measured} for each in walk.findings],
    }
