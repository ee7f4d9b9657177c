"""Served cell of the campaign: real drivers over emulated boards, bridge, journal and supervisor, and a PLC."""

import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from cell.config.load import LoadedConfig
from cell.config.parameters import PARAMETERS
from cell.devices.assembly import Cell, assemble, opened
from cell.lab.faults.cases import LONGEST
from cell.records.journal import Journal
from cell.run.line import PROGRAMS
from cell.run.states import State
from cell.run.supervisor import Supervisor
from drivers.errors import CellError
from drivers.protocols import Clock
from drivers.quantities import Vector
from plc_bridge.bridge import Bridge
from plc_bridge.peer import CellSilentError, Peer
from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.messages import Report
from sim.boards.board_links import EmulatedCan
from sim.boards.faulty import FaultyDevice
from sim.boards.switch_board import EmulatedSwitchBoard
from sim.world.truth import Truth
from skills.catalogue import CATALOGUE, RECOVER
from skills.guards.rest import REST_SPEED

WAITING = (State.IDLE, State.COMPLETE, State.STOPPED, State.ABORTED, State.HELD)
"""States that wait for a command."""
LIFE_TIMEOUT, PATIENCE = 2.0, 30.0
"""Times after which a silent PLC counts as lost, s of wall time. The first is for faults that silence the PLC. The
second is for all other faults and long, for busy computers; it is also the PLC's timeout for an answer."""
LEASE_TIMEOUT = 30.0
"""Silence after which the lease is free again, s of wall time."""
CYCLE = 0.02
"""Time between two checks of the cell, s of wall time."""
TURN = 0.0005
"""Time that an idle scan leaves to the other threads, s of wall time."""
GOING_ON = (State.STARTING, State.EXECUTE, State.COMPLETING)
"""States in which a program is running."""
REST_LIMIT = 0.3
"""Longest time from the detection of a fault to rest, s."""
KEYS = ("skin.kind=can", "switch.kind=serial", "switch.port=emulated", "hole.area=[0.03,0.03]")
"""Config keys of a cell with emulated wires, and with a small area in which the search finds the hole within seconds."""


class Hurried(threading.Event):
    """Event that requests the end of the program; `wait` returns early, because simulated time need not wait for the wall clock."""

    def wait(self, timeout: float | None = None) -> bool:
        """Yield to other threads, and return True if the end is requested."""
        time.sleep(TURN)
        return self.is_set()


@dataclass(slots=True)
class Sighting:
    """Observation of the arm after the fault; times on the cell's clock, s."""

    injected: float | None = None
    detected: float | None = None
    """Time of detection: the first scan with a fault in the report, with the run's recovery under way, or in a state in
    which no program runs."""
    moved: float = 0.0
    """Time of the arm's last motion."""
    stood: Vector | None = None
    """Position of the hand `REST_LIMIT` after the detection, when the hand must be at rest, shape (3,), m, base frame."""
    creep: float = 0.0
    """Largest later distance of the hand from that position, m."""
    peak_force: float = 0.0
    """Largest external force at the TCP, from the arm's own estimate, N."""
    contact_force: float = 0.0
    """Largest net force of the plates on the held peg since the grasp, N."""


@dataclass(slots=True)
class WatchedClock:
    """The cell's clock, which calls `look` at every scan, so that the bench can inject a fault and observe the arm."""

    clock: Clock
    look: Callable[[float], None] = lambda now: None

    def now(self) -> float:
        """Return the cell's time, s."""
        return self.clock.now()

    def wait_until(self, stamp: float) -> None:
        """Wait, then observe."""
        self.clock.wait_until(stamp)
        self.look(self.clock.now())


class FaultyPeer(Peer):
    """A PLC that writes torn command blocks until a given time."""

    torn_until = 0.0
    """Monotonic time until which the tail life counter of each block is older than the head, s."""

    def _write(self, image: CommandImage) -> None:
        if time.monotonic() < self.torn_until:
            image = replace(image, life_tail=(image.life - 1) % 0x10000)
        super()._write(image)


@dataclass(slots=True)
class FaultBench:
    """The served cell; faults can act on its devices, its PLC and its program."""

    loaded: LoadedConfig
    cell: Cell
    arm: FaultyDevice
    gripper: FaultyDevice
    switch: FaultyDevice
    wire: EmulatedCan
    board: EmulatedSwitchBoard
    journal: Journal
    bridge: Bridge
    peer: FaultyPeer
    supervisor: Supervisor
    stop: threading.Event
    thread: threading.Thread
    seen: Sighting = field(default_factory=Sighting)
    stage: int = 0
    """Number of the stage in which the fault is due; 0 if none is due."""
    delay: float = 0.0
    """Time from the stage's first scan to the fault, s."""
    inject: Callable[[], None] = lambda: None
    plc_act: Callable[[], None] | None = None
    """Action that the PLC's thread executes in its next cycle."""
    is_plc_lost: bool = False
    """True if the PLC that started the run never reads the end of the run."""
    _entered: float | None = None
    _before: int = 0
    """Number of the run before the run with the fault."""

    @property
    def truth(self) -> Truth:
        """True state of the cell."""
        assert self.cell.truth is not None
        return self.cell.truth()

    def run(self, code: int) -> Report:
        """Trigger a command and return its result or refusal; if the PLC is lost meanwhile, return the report after reconnecting.

        Raises:
            CellError: The cell does not answer.
        """
        self.is_plc_lost = False
        try:
            self.peer.trigger(code)
            report = self.peer.wait_for_result(LONGEST, lambda report: self._act())
            self.peer.acknowledge()
            return report
        except CellSilentError:
            if not self.is_plc_lost:
                raise
        deadline = time.monotonic() + LONGEST
        while self.supervisor.state not in WAITING and time.monotonic() < deadline:
            time.sleep(CYCLE)
        return self.connect()

    def connect(self) -> Report:
        """Reconnect and take the lease."""
        self.peer.close()
        self.peer = FaultyPeer(*self.bridge.address, timeout=PATIENCE)
        self.peer.connect()
        self.peer.take()
        return self.peer.cycle()

    def let_pass(self, length: float) -> None:
        """Let the PLC cycle until the cell's clock has advanced by this time, s, or the program has ended.

        Raises:
            CellError: The cell does not answer.
        """
        end, deadline = self.cell.clock.now() + length, time.monotonic() + LONGEST
        while self.cell.clock.now() < end and self.thread.is_alive() and time.monotonic() < deadline:
            self.peer.cycle()
            time.sleep(CYCLE)

    def _act(self) -> None:
        """Execute the PLC's pending action."""
        act, self.plc_act = self.plc_act, None
        if act is not None:
            act()

    def restart(self) -> None:
        """Serve again after the program has ended."""
        self.thread.join()
        self.stop.clear()
        self.supervisor = Supervisor(self.cell, self.loaded, self.bridge, self.journal, self.stop)
        self.thread = _scanning(self.supervisor)

    def end(self) -> None:
        """End the program."""
        self.stop.set()
        self.thread.join()

    def arm_fault(self, stage: str, delay: float, inject: Callable[[], None]) -> None:
        """Schedule a fault `delay` seconds after `stage` begins."""
        self.seen, self._entered = Sighting(), None
        self._before = self.supervisor.report.run
        self.delay, self.inject, self.stage = delay, inject, CATALOGUE.stage_number(stage)

    def look(self, now: float) -> None:
        """Inject a fault that is due, and observe the arm after a fault; called once per scan."""
        if self.stage:
            self._inject_if_due(now)
        if self.seen.injected is not None:
            self._observe(now)

    def _inject_if_due(self, now: float) -> None:
        report = self.supervisor.report
        if self._entered is None and report.stage == self.stage and report.run not in (0, self._before):
            self._entered = now
        if self._entered is not None and now >= self._entered + self.delay:
            self.stage, self.seen.injected = 0, now
            self.inject()

    def _observe(self, now: float) -> None:
        """Observe an arm after the fault: its detection, its motion and its forces."""
        report, seen = self.supervisor.report, self.seen
        is_over = report.stage == RECOVER.stage or self.supervisor.state not in GOING_ON
        if seen.detected is None and (report.fault or is_over):
            seen.detected = now
        truth = self.truth
        if truth.joint_speed > REST_SPEED:
            seen.moved = now
        seen.contact_force = max(seen.contact_force, truth.peak_contact_force)
        with suppress(CellError):
            arm = self.arm.device.read()
            seen.peak_force = max(seen.peak_force, float(np.linalg.norm(arm.wrench.force)))
            if seen.detected is not None and now >= seen.detected + REST_LIMIT:
                seen.stood = arm.tcp.position if seen.stood is None else seen.stood
                seen.creep = max(seen.creep, float(np.linalg.norm(arm.tcp.position - seen.stood)))


@contextmanager
def bench(loaded: LoadedConfig, life_timeout: float = PATIENCE) -> Iterator[FaultBench]:
    """Yield a served cell, then close it; `life_timeout` is the least timeout of a silent PLC, s of wall time."""
    plc = loaded.cell.plc
    patient = plc.model_copy(
        update={
            "modbus": plc.modbus.model_copy(update={"port": 0}),
            "life_timeout": max(plc.life_timeout, life_timeout),
            "lease_timeout": max(plc.lease_timeout, LEASE_TIMEOUT),
        }
    )
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        made = assemble(loaded.cell)
        arm, gripper, switch = (FaultyDevice(device) for device in (made.arm, made.gripper, made.switch))
        clock = WatchedClock(made.clock)
        cell = replace(made, arm=arm, gripper=gripper, switch=switch, clock=clock)
        journal = stack.enter_context(Journal(folder))
        stack.enter_context(opened(cell))
        bridge, stop = Bridge(patient, PROGRAMS, PARAMETERS), Hurried()
        supervisor = Supervisor(cell, loaded, bridge, journal, stop)
        supervisor.scan()
        bridge.start()
        stack.callback(bridge.close)
        assert isinstance(made.skin_wire, EmulatedCan)
        (board,) = (each for each in made.boards if isinstance(each, EmulatedSwitchBoard))
        peer = FaultyPeer(*bridge.address, timeout=PATIENCE)
        thread = _scanning(supervisor)
        tried = FaultBench(
            loaded, cell, arm, gripper, switch, made.skin_wire, board, journal, bridge, peer, supervisor, stop, thread
        )
        stack.callback(tried.end)
        stack.callback(lambda: tried.peer.close())
        clock.look = tried.look
        peer.connect()
        peer.take()
        yield tried


def _scanning(supervisor: Supervisor) -> threading.Thread:
    """Start the thread that serves the cell, and return it."""

    def serve() -> None:
        with suppress(Exception):  # the report and the record contain the reason of the end
            supervisor.serve()

    thread = threading.Thread(target=serve, name="scan")
    thread.start()
    return thread
