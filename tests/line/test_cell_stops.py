"""Whatever ends the program: the arm comes to rest and the record of the run is closed first."""

import threading
from contextlib import closing

import numpy as np
import pytest

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from cell.records.journal import Journal
from cell.run.line import TerminalLine
from cell.run.states import State
from cell.run.supervisor import Supervisor
from drivers.errors import FaultCode, SimulationUnstableError
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import Command, Control, Result
from sim.world.physics import World
from skills.catalogue import CATALOGUE
from skills.contract import Outcome, Reason, SkillResult
from skills.entry import Program
from skills.flow import run_stage
from skills.guards.rest import REST_SPEED
from tests.trouble import first

PATIENCE = 10.0  # s
GRASP = CATALOGUE["grasp_from_rack"].code


def grasping(at):
    """Return a terminal that gives one command and calls `at` with every report."""
    return TerminalLine(Command(1, GRASP), at)


def faults(journal):
    return [event for event in journal.events() if event.kind == "fault"]


@pytest.fixture
def world(tmp_path, monkeypatch):
    """Yield config, opened cell and journal of the simulated cell as fast as it goes."""
    monkeypatch.chdir(tmp_path)  # the physics engine leaves a log where it runs
    loaded = load(sets=["sim.pace=max"])
    with Journal(tmp_path) as journal, opened(assemble(loaded.cell)) as cell:
        yield loaded, cell, journal


def moving(cell):
    """Return the speed of the fastest joint, rad/s."""
    return float(np.max(np.abs(cell.arm.read().dq)))


def test_the_arm_stands_still_before_the_program_ends(world):
    loaded, cell, journal = world
    stop, fastest = threading.Event(), []

    def at(report):
        if report.state == State.EXECUTE and moving(cell) > 0.3 and not stop.is_set():
            fastest.append(moving(cell))
            stop.set()

    Supervisor(cell, loaded, grasping(at), journal, stop).serve()
    assert fastest[0] > 0.3
    assert moving(cell) < REST_SPEED
    assert (journal.find(1).outcome, journal.find(1).reason) == ("aborted", "stopped")


def test_an_error_in_the_supervisor_is_a_fault_on_record(world, monkeypatch):
    loaded, cell, journal = world

    def at(report):
        if report.fault:
            supervisor.quit()

    def broken(outcome):
        raise RuntimeError(f"nobody thought of {outcome}")

    supervisor = Supervisor(cell, loaded, grasping(at), journal)
    monkeypatch.setattr(supervisor._execution, "_settle", broken)
    supervisor.serve()
    assert moving(cell) < REST_SPEED
    assert (supervisor.report.state, supervisor.report.fault) == (State.ABORTED, FaultCode.SOFTWARE)
    assert journal.find(1).outcome == "success"
    assert [event.text for event in faults(journal)] == ["RuntimeError: nobody thought of success"]


def test_physics_that_diverge_end_the_program_with_the_run_on_record(world, tmp_path):
    loaded, cell, journal = world
    physics = cell.arm._world
    assert isinstance(physics, World)

    def at(report):
        if report.state == State.EXECUTE and report.fault == 0:
            physics.physics()[1].qvel[:7] = np.inf

    with pytest.raises(SimulationUnstableError):
        Supervisor(cell, loaded, grasping(at), journal).serve()
    assert journal.find(1).outcome == "fault"
    assert faults(journal)[-1].code == FaultCode.SIMULATION_UNSTABLE
    assert not list(tmp_path.glob("MUJOCO*"))


def test_a_skill_that_blocks_halts_the_arm_and_is_named(served, monkeypatch):
    goes_on = threading.Event()

    def block(ctx):
        for _ in ctx.scan(1e9):
            goes_on.wait()
        return SkillResult(Outcome.SUCCESS, Reason.NONE, 0.0)

    program = Program(name="stuck", code=GRASP, run=lambda skills, ctx: [run_stage("grasp_from_rack", block, ctx)])
    monkeypatch.setitem(CATALOGUE.by_code, GRASP, program)
    with closing(Peer(*served.bridge.address)) as plc:
        plc.connect()
        plc.trigger(GRASP)
        blocked = first(plc.cycle, lambda report: report.fault == FaultCode.SCAN_OVERRUN)
        assert blocked.state == State.ABORTING
        goes_on.set()
        ended = first(plc.cycle, lambda report: report.result != Result.NONE)
        assert (ended.result, ended.fault) == (Result.FAULT, FaultCode.SCAN_OVERRUN)
        assert served.record(ended.run).message.startswith("grasp_from_rack: no scan for 0.2")
        assert plc.run(Control.RESET, timeout=PATIENCE).result == Result.SUCCESS
