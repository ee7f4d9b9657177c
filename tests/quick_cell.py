"""A served cell without physics: the real bridge and supervisor over instant fakes, and one program that obeys the test."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from cell.config.load import LoadedConfig
from cell.config.parameters import PARAMETERS
from cell.devices.assembly import Cell
from cell.records.journal import Journal
from cell.records.schema import RunRow
from cell.run.desk import CommandLine
from cell.run.line import PROGRAMS
from cell.run.live import Live
from cell.run.supervisor import Supervisor
from drivers.errors import CellError
from plc_bridge.bridge import Bridge
from plc_bridge.config import PlcConfig
from skills.catalogue import CATALOGUE
from skills.contract import Outcome, Reason, SkillContext, SkillResult
from skills.entry import Program, SkillSet
from skills.flow import StageRecord, run_stage
from tests.fakes import FakeArm, FakeClock, FakeGripper, FakeSkin, FakeSwitch

CODE, STAGE = 100, "grasp_from_rack"
AGES = 1e9  # s


class BriefClock(FakeClock):
    """A fake clock that lets the other threads have their turn."""

    def wait_until(self, stamp: float) -> None:
        super().wait_until(stamp)
        threading.Event().wait(0.0005)


class QuickProgram:
    """Ends at once, or when it is let go, in the way that is set; remembers the parameters of every run."""

    def __init__(self) -> None:
        self.may_end = threading.Event()
        self.may_end.set()
        self.outcome, self.reason = Outcome.SUCCESS, Reason.NONE
        self.fault: CellError | None = None
        self.runs: list[SkillSet] = []
        self.context: SkillContext

    def __call__(self, skills: SkillSet, ctx: SkillContext) -> list[StageRecord]:
        self.runs.append(skills)
        self.context = ctx
        return [run_stage(STAGE, self._run, ctx)]

    def _run(self, ctx: SkillContext) -> SkillResult:
        for seen in ctx.scan(AGES):
            if self.fault is not None:
                raise self.fault
            if self.may_end.is_set():
                return SkillResult(self.outcome, self.reason, seen.elapsed)
        raise AssertionError("the program was never let go")


class QuickCell:
    """Handles of a test on the cell that it commands."""

    def __init__(self, bridge: Bridge, program: QuickProgram, live: Live, journal: Journal) -> None:
        self.bridge, self.program, self.live, self.journal = bridge, program, live, journal
        self.folder = journal.folder

    def record(self, run: int) -> RunRow:
        """Return the row of one run."""
        return self.journal.find(run)


@contextmanager
def quick_cell(
    loaded: LoadedConfig,
    plc: PlcConfig,
    folder: Path,
    code: int = CODE,
    watched: Callable[[Bridge], CommandLine] | None = None,
    opcua: tuple[str, int] | None = None,
) -> Iterator[QuickCell]:
    """Yield a cell that is served until the end; the quick program has `code`, and `watched` may stand before its line."""
    config = loaded.cell
    clock = BriefClock()
    hand = FakeGripper(config.peg.part.thickness)
    devices = FakeArm(clock), hand, FakeSkin(clock, hand), FakeSwitch()
    made = Cell(config, clock, *devices, lambda *job: None, cables={"skin": devices[2]})
    bridge, program, stop = Bridge(plc, PROGRAMS, PARAMETERS, opcua=opcua), QuickProgram(), threading.Event()

    journal, live = Journal(folder), Live()
    line = watched(bridge) if watched is not None else bridge
    supervisor = Supervisor(made, loaded, line, journal, stop, live)

    journal.open()
    supervisor.scan()
    bridge.start()
    table = CATALOGUE.by_code
    before = table[code]
    table[code] = Program(name=before.name, code=code, run=program, stages=(STAGE,), starts_empty=code == CODE)
    thread = threading.Thread(target=supervisor.serve)
    thread.start()
    try:
        yield QuickCell(bridge, program, live, journal)
    finally:
        stop.set()
        thread.join()
        journal.close()
        bridge.close()
        table[code] = before
