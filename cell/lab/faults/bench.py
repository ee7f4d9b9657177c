"""The served cell of the campaign: real drivers over emulated boards, bridge, journal and supervisor, and a PLC beside it."""

import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from cell.assembly import Cell, assemble, opened
from cell.config import LoadedConfig
from cell.journal import Journal
from cell.lab.faults.devices import FaultyArm, FaultyGripper, FaultySwitch
from cell.line import PARAMETERS, PROGRAMS
from cell.states import State
from cell.supervisor import Supervisor
from drivers.errors import CellError
from drivers.protocols import Clock
from plc_bridge.bridge import Bridge
from plc_bridge.peer import Peer
from sim.board_links import EmulatedCan
from sim.switch_board import EmulatedSwitchBoard
from skills.catalogue import CATALOGUE
from skills.rest import REST_SPEED

GOING_ON = (State.STARTING, State.EXECUTE, State.COMPLETING)
"""States in which a program goes on."""
KEYS = ("skin.kind=can", "switch.kind=serial", "switch.port=emulated")
"""Keys of a cell that is driven through its wires."""


@dataclass(slots=True)
class Sighting:
    """Observation of the arm from the fault on; times on the cell's clock, s."""

    injected: float | None = None
    detected: float | None = None
    """Time at which the report had a fault, or the state was no longer one in which a program goes on."""
    moved: float = 0.0
    """Time of the arm's last motion."""
    peak_force: float = 0.0
    """Largest external force at the TCP by the arm's own estimate, N."""


@dataclass(slots=True)
class WatchedClock:
    """The cell's clock, which does something at a moment of a stage and looks at the arm at every scan."""

    clock: Clock
    look: Callable[[float], None] = lambda now: None

    def now(self) -> float:
        """Return the cell's time, s."""
        return self.clock.now()

    def wait_until(self, stamp: float) -> None:
        """Wait, then look."""
        self.clock.wait_until(stamp)
        self.look(self.clock.now())


@dataclass(slots=True)
class FaultBench:
    """The served cell in the reach of the faults."""

    loaded: LoadedConfig
    cell: Cell
    arm: FaultyArm
    gripper: FaultyGripper
    switch: FaultySwitch
    wire: EmulatedCan
    board: EmulatedSwitchBoard
    journal: Journal
    bridge: Bridge
    peer: Peer
    supervisor: Supervisor
    stop: threading.Event
    thread: threading.Thread
    seen: Sighting = field(default_factory=Sighting)
    stage: int = 0
    """Number of the stage in which the fault is due; 0 when none is due."""
    delay: float = 0.0
    """Time from the stage's first scan to the fault, s."""
    inject: Callable[[], None] = lambda: None
    _entered: float | None = None

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
        """Let a fault happen `delay` seconds after `stage` begins."""
        self.seen, self._entered = Sighting(), None
        self.delay, self.inject, self.stage = delay, inject, CATALOGUE.stage_number(stage)

    def look(self, now: float) -> None:
        """Inject what is due, and look at the arm, at every scan."""
        report, seen = self.supervisor.report, self.seen
        if self.stage and report.stage == self.stage and self._entered is None:
            self._entered = now
        if self.stage and self._entered is not None and now >= self._entered + self.delay:
            self.stage, seen.injected = 0, now
            self.inject()
        if seen.injected is None:
            return
        if seen.detected is None and (report.fault or self.supervisor.state not in GOING_ON):
            seen.detected = now
        with suppress(CellError):
            state = self.arm.arm.read()
            if float(np.max(np.abs(state.dq))) > REST_SPEED:
                seen.moved = now
            seen.peak_force = max(seen.peak_force, float(np.linalg.norm(state.wrench.force)))


@contextmanager
def bench(loaded: LoadedConfig) -> Iterator[FaultBench]:
    """Yield a served cell, which is closed at the end."""
    plc = loaded.cell.plc
    patient = plc.model_copy(
        update={
            "modbus": plc.modbus.model_copy(update={"port": 0}),
            "life_timeout": max(plc.life_timeout, 30.0),
            "lease_timeout": max(plc.lease_timeout, 30.0),
        }
    )
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        made = assemble(loaded.cell)
        arm, gripper, switch = FaultyArm(made.arm), FaultyGripper(made.gripper), FaultySwitch(made.switch)
        clock = WatchedClock(made.clock)
        cell = replace(made, arm=arm, gripper=gripper, switch=switch, clock=clock)
        journal = stack.enter_context(Journal(folder))
        stack.enter_context(opened(cell))
        bridge, stop = Bridge(patient, PROGRAMS, PARAMETERS), threading.Event()
        supervisor = Supervisor(cell, loaded, bridge, journal, stop)
        supervisor.scan()
        bridge.start()
        stack.callback(bridge.close)
        assert isinstance(made.skin_wire, EmulatedCan)
        (board,) = (each for each in made.boards if isinstance(each, EmulatedSwitchBoard))
        peer = Peer(*bridge.address)
        stack.callback(peer.close)
        thread = _scanning(supervisor)
        tried = FaultBench(
            loaded, cell, arm, gripper, switch, made.skin_wire, board, journal, bridge, peer, supervisor, stop, thread
        )
        stack.callback(tried.end)
        clock.look = tried.look
        peer.connect()
        peer.take()
        yield tried


def _scanning(supervisor: Supervisor) -> threading.Thread:
    """Return the thread that serves."""

    def serve() -> None:
        with suppress(Exception):  # the report and the record tell what ended it
            supervisor.serve()

    thread = threading.Thread(target=serve, name="scan")
    thread.start()
    return thread
