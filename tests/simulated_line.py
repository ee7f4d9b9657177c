"""A cell with physics in one thread, for its skills alone, or under its supervisor with a PLC in the cell's own time."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from cell.config.load import LoadedConfig, load
from cell.config.parameters import PARAMETERS
from cell.devices.assembly import Cell, assemble, opened
from cell.peg.part_state import UNRESOLVED
from cell.records.journal import Journal
from cell.run.line import PROGRAMS
from cell.run.states import State
from cell.run.supervisor import Supervisor
from drivers.protocols import Clock
from plc_bridge.bridge import Bridge
from plc_bridge.protocol.messages import Control, PartPlace, Report
from sim.world.physics import World
from skills.catalogue import CATALOGUE
from skills.contract import SkillContext
from tests.fakes import FakePlc

INSERT, GRASP, RELEASE, RECOVER = (
    CATALOGUE[name].code for name in ("insert_peg", "grasp_from_rack", "release_and_retract", "recover")
)


class ScanClock:
    """The cell's clock, which calls its listeners after each scan."""

    def __init__(self, clock: Clock) -> None:
        self.inner = clock
        self.every: list[Callable[[], None]] = []

    def now(self) -> float:
        return self.inner.now()

    def wait_until(self, stamp: float) -> None:
        self.inner.wait_until(stamp)
        for action in list(self.every):
            action()


class HeardBridge(Bridge):
    """A bridge that remembers the state of every report that was published."""

    def publish(self, report: Report) -> None:
        self.states = [*getattr(self, "states", []), State(report.state)]
        super().publish(report)


@dataclass
class Line:
    """A cell, its supervisor and a PLC."""

    cell: Cell
    supervisor: Supervisor
    plc: FakePlc
    clock: ScanClock
    bridge: HeardBridge
    journal: Journal

    @property
    def world(self) -> World:
        """World of a cell whose devices are all simulated."""
        world = self.clock.inner
        assert isinstance(world, World)
        return world

    def command(self, code: int, recipe: int = 0) -> Report:
        """Let the cell obey to the end, and return what the PLC reads then."""
        self.plc.trigger(code, recipe)
        return self.scan(3)

    def scan(self, times: int) -> Report:
        """Scan, outside a program so many times, and return what the PLC reads then."""
        for _ in range(times):
            self.supervisor.scan()
        return self.plc.report

    def wait(self, seconds: float) -> None:
        """Let the cell wait for commands for so long."""
        end = self.clock.now() + seconds
        while (before := self.clock.now()) < end:
            self.supervisor.scan()
            assert self.clock.now() > before, f"time stands still: {self.plc.report}"

    def when(self, is_due: Callable[[Report], bool], action: Callable[[], None]) -> None:
        """Do something once, after the first scan whose report is so."""

        def look() -> None:
            if is_due(self.plc.report):
                self.clock.every.remove(look)
                action()

        self.clock.every.append(look)

    def insert(self, stage: str = "", delay: float = 0.0, action: Callable[[], None] = lambda: None) -> Report:
        """Insert a peg; so long, s, after `stage` begins, something happens.

        A person takes a peg away first that the run before left somewhere.
        """
        if self.plc.report.part in UNRESOLVED:
            assert self.command(Control.CLEARED).part == PartPlace.RACK
        begun, number = [], CATALOGUE.stage_number(stage)

        def is_due(report: Report) -> bool:
            if report.stage == number:
                begun.append(self.clock.now())
            return bool(begun) and self.clock.now() >= begun[0] + delay

        if stage:
            self.when(is_due, action)
        report = self.command(INSERT)
        assert begun or not stage, f"{stage} was never reached: {report}"
        return report


@contextmanager
def at_work(seed: int, *sets: str) -> Iterator[tuple[Cell, SkillContext]]:
    """Yield an opened cell as fast as it goes, and what its skills run in."""
    with opened(assemble(load(sets=["sim.pace=max", f"sim.seed={seed}", *sets]).cell)) as cell:
        yield cell, cell.context(seed)


@contextmanager
def running(cell: Cell, loaded: LoadedConfig, folder: Path) -> Iterator[Line]:
    """Yield a line with an opened cell whose records are in a folder."""
    with Journal(folder) as journal:
        clock = ScanClock(cell.clock)
        cell = replace(cell, clock=clock)
        bridge = HeardBridge(loaded.cell.plc, PROGRAMS, PARAMETERS, now=clock.now)
        supervisor = Supervisor(cell, loaded, bridge, journal)
        yield Line(cell, supervisor, FakePlc(bridge, clock), clock, bridge, journal)
        supervisor._part.flush()  # as at the end of `serve`


@contextmanager
def line(folder: Path, *sets: str, seed: int = 1, **devices: Callable[[Cell], object]) -> Iterator[Line]:
    """Yield a line whose hole is soon found; `devices` makes a device out of the one that the cell has, by name."""
    loaded = load(sets=["sim.pace=max", "reality.scale=0.0", "hole.area=[0.01, 0.01]", f"sim.seed={seed}", *sets])
    with opened(assemble(loaded.cell)) as cell:
        made = replace(cell, **{name: make(cell) for name, make in devices.items()})
        with running(made, loaded, folder) as running_line:
            yield running_line
