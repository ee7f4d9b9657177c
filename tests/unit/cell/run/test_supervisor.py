"""Answers of a cell to a PLC's commands: states, results, refusals, and the motion of the arm."""

import json
import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cell.config.load import load
from cell.records.journal import Journal
from cell.records.schema import EventKind
from cell.run import supervisor
from cell.run.live import CablePull, Live
from cell.run.states import State
from cell.run.supervisor import Supervisor
from drivers.errors import ArmReflexError, CellError, FaultCode, SkinSilentError
from plc_bridge.protocol.messages import Command, Control, PartPlace, Refusal, Result
from skills.catalogue import CATALOGUE, RECOVER
from skills.contract import Outcome, Reason
from skills.entry import Claim, Program
from skills.guards.scan_guards import RESUME_TIME
from tests.fakes import Rig
from tests.quick_cell import STAGE, QuickProgram
from tests.unit.cell.run.test_watchdog import Looked

CODE = 101
STAGE_NUMBER = CATALOGUE.stage_number(STAGE)
UNKNOWN_CODE, UNKNOWN_RECIPE = 999, 4711


@pytest.fixture
def program(rig, monkeypatch):
    """Return a program that replaces the grasp and ends when and how the test prescribes."""
    made = QuickProgram()
    entry = Program(name=STAGE, code=CODE, run=made, stages=(STAGE,), starts_empty=False)
    monkeypatch.setitem(CATALOGUE.by_code, CODE, entry)
    rig.scan()
    return made


def runs_on(rig, program, time=1.0):
    """Let the program run so long, s."""
    program.may_end.clear()
    rig.at(time, program.may_end.set)


def read(rig, delay):
    """Return what will be read so much later, s: a list that is filled then."""
    told = []
    rig.at(delay, lambda: told.append(rig.plc.report))
    return told


def moves_for(rig, time):
    """Let the arm move for so long, s."""
    rig.arm.dq = rig.arm.dq + 0.5
    rig.at(time, lambda: setattr(rig.arm, "dq", 0.0 * rig.arm.dq))


def inserts(rig, monkeypatch, claim=Claim.NOTHING):
    """Return a program that replaces the insertion of a fresh peg."""
    rig.scan()
    made = QuickProgram()
    entry = Program(name="insert_peg", code=100, run=made, stages=(STAGE,), starts_empty=True, claim=claim)
    monkeypatch.setitem(CATALOGUE.by_code, 100, entry)
    return made


@pytest.fixture
def live(rig):
    """Return what viewers of the cell see."""
    made = Live()
    rig.supervisor = Supervisor(rig.cell, rig.loaded, rig.bridge, rig.journal, live=made)
    return made


class Quit(threading.Event):
    """The end of a served cell, which idles without waiting."""

    def wait(self, timeout=None):
        return self.is_set()


@pytest.fixture
def looked(rig, live, monkeypatch):
    """Return what makes the cell's watchdog look."""
    made = Looked(monkeypatch)
    rig.supervisor = Supervisor(rig.cell, rig.loaded, rig.bridge, rig.journal, Quit(), live)
    return made


def serve(rig, code=None, time=2.0):
    """Serve so long, s, with one command."""
    if code is not None:
        rig.plc.trigger(code)
    rig.at(time, rig.supervisor.quit)
    rig.supervisor.serve()


@pytest.mark.parametrize(
    ("outcome", "reason", "result", "state"),
    [
        (Outcome.SUCCESS, Reason.NONE, Result.SUCCESS, State.COMPLETE),
        (Outcome.FAILURE, Reason.MISSED_GRASP, Result.FAILURE, State.COMPLETE),
        (Outcome.ABORTED, Reason.STOPPED, Result.ABORTED, State.STOPPED),
    ],
)
def test_a_run_is_reported_and_recorded_as_it_ended(rig, program, outcome, reason, result, state):
    program.outcome, program.reason = outcome, reason
    report = rig.command(CODE)
    assert (report.result, report.state, report.reason, report.stage) == (result, state, reason, STAGE_NUMBER)
    assert (report.run, report.progress == 100) == (1, outcome is not Outcome.ABORTED)
    row = rig.journal.find(1)
    why = "" if reason is Reason.NONE else reason.name.lower()
    assert (row.outcome, row.reason, row.stage, row.fault) == (outcome, why, STAGE, 0)
    assert rig.supervisor.last == row
    assert rig.arm.is_halted


def test_a_run_reports_number_stage_state_and_time(rig, program):
    runs_on(rig, program)
    told = read(rig, 0.5)
    after = rig.command(CODE)
    (during,) = told
    assert (during.state, during.run, during.stage, during.result) == (State.EXECUTE, 1, STAGE_NUMBER, Result.NONE)
    assert after.stage_times[STAGE_NUMBER - 1] == pytest.approx(1.0, abs=0.03)
    assert rig.command(CODE).run == 2


def test_an_acknowledged_result_leaves_an_idle_cell(rig, program):
    assert rig.command(CODE).state == State.COMPLETE
    rig.plc.acknowledge()
    assert rig.scan().state == State.IDLE


def test_an_insertion_without_proof_by_the_switch_is_a_fault(rig, monkeypatch):
    inserts(rig, monkeypatch, Claim.INSERTED)
    report = rig.command(100)
    assert (report.result, report.state) == (Result.FAULT, State.ABORTED)
    assert report.fault == FaultCode.SUCCESS_UNPROVEN
    assert (rig.journal.find(1).outcome, len(rig.restocked)) == ("fault", 1)


def test_each_insertion_takes_the_next_slot_and_seed(rig, monkeypatch):
    failing = inserts(rig, monkeypatch)
    failing.outcome, failing.reason = Outcome.FAILURE, Reason.MISSED_GRASP
    first = rig.loaded.cell.sim.seed
    for _ in range(3):
        rig.command(100)
    assert [(job.slot, seed) for job, seed in rig.restocked] == [(0, first), (1, first + 1), (2, first + 2)]
    assert [rig.journal.find(run).seed for run in (1, 2, 3)] == [first, first + 1, first + 2]


# Refusals.


@pytest.mark.parametrize(
    ("code", "recipe", "refusal"),
    [
        (UNKNOWN_CODE, 0, Refusal.UNKNOWN_CODE),
        (CODE, UNKNOWN_RECIPE, Refusal.UNKNOWN_RECIPE),
        (Control.UNHOLD, 0, Refusal.NOT_READY),
        (Control.HOLD, 0, Refusal.NOT_READY),
        (Control.FORGET, UNKNOWN_RECIPE, Refusal.UNKNOWN_RECIPE),
    ],
)
def test_an_impossible_command_is_refused_and_changes_nothing(rig, program, code, recipe, refusal):
    report = rig.command(code, recipe)
    assert (report.refusal, report.state, report.run) == (refusal, State.IDLE, 0)
    assert program.runs == []


@pytest.mark.parametrize("code", [CODE, Control.CLEARED, Control.REFILLED, Control.FORGET])
def test_a_command_during_a_run_is_refused(rig, program, code):
    runs_on(rig, program)
    told = read(rig, 0.6)
    rig.at(0.5, lambda: rig.plc.trigger(code))
    rig.command(CODE)
    assert (told[0].refusal, len(program.runs)) == (Refusal.BUSY, 1)


@pytest.mark.parametrize(("control", "state"), [(Control.STOP, State.STOPPED), (Control.ABORT, State.ABORTED)])
def test_a_stopped_cell_starts_only_after_a_reset(rig, program, control, state):
    for _ in range(2):
        report = rig.command(control)
        assert (report.refusal, report.state) == (Refusal.NONE, state)
    assert rig.command(CODE).refusal == Refusal.NOT_READY
    assert rig.command(Control.RESET).state == State.IDLE
    assert rig.command(CODE).result == Result.SUCCESS


def test_a_peg_that_a_person_cleared_is_resolved(rig, program):
    rig.gripper.grip(30.0)
    assert rig.scan().part == PartPlace.IN_HAND
    rig.gripper.release(0.04)
    assert rig.scan().part == PartPlace.UNKNOWN
    assert rig.command(100).refusal == Refusal.PART_UNRESOLVED
    report = rig.command(Control.CLEARED)
    assert (report.part, report.refusal) == (PartPlace.RACK, Refusal.NONE)
    assert rig.command(Control.REFILLED).refusal == Refusal.NONE


# Stop, hold, faults.


@pytest.mark.parametrize(
    ("end", "acting", "final"),
    [
        (lambda rig: rig.plc.trigger(Control.STOP), State.STOPPING, State.STOPPED),
        (lambda rig: rig.plc.trigger(Control.ABORT), State.ABORTING, State.ABORTED),
        (lambda rig: rig.supervisor.quit(), State.STOPPING, State.STOPPED),
    ],
    ids=["stop", "abort", "end of the program"],
)
def test_an_interrupted_run_halts_the_arm_and_is_recorded_as_aborted(rig, program, end, acting, final):
    runs_on(rig, program, 9.0)
    rig.at(0.5, lambda: end(rig))
    rig.at(0.5, lambda: moves_for(rig, 0.1))
    during = read(rig, 0.53)
    report = rig.command(CODE)
    assert (during[0].state, report.state, report.fault) == (acting, final, 0)
    assert (rig.journal.find(1).outcome, rig.journal.find(1).reason) == ("aborted", "stopped")
    assert rig.arm.is_halted
    assert rig.clock.now() < 1.0


def test_a_stop_while_a_run_is_prepared_leaves_the_hand_as_it_is(rig):
    cell = replace(rig.cell, restock=lambda job, seed: rig.plc.trigger(Control.STOP))
    rig.supervisor, rig.gripper.width = Supervisor(cell, rig.loaded, rig.bridge, rig.journal), 0.03
    rig.scan()
    report = rig.command(CODE)
    assert (report.state, report.result, rig.gripper.width) == (State.STOPPED, Result.ABORTED, 0.03)


def test_held_is_reported_at_rest_and_the_run_continues(rig, program):
    runs_on(rig, program, 5.0)
    rig.at(0.5, lambda: rig.plc.trigger(Control.HOLD))
    holding, held = read(rig, 0.52), read(rig, 1.0)
    rig.at(2.0, lambda: rig.plc.trigger(Control.UNHOLD))
    back, on = read(rig, 2.0 + 0.5 * RESUME_TIME), read(rig, 2.05 + RESUME_TIME)
    report = rig.command(CODE)
    states = [told[0].state for told in (holding, held, back, on)]
    assert states == [State.HOLDING, State.HELD, State.UNHOLDING, State.EXECUTE]
    assert (report.state, report.result) == (State.COMPLETE, Result.SUCCESS)


def test_nothing_follows_a_recovery_that_failed(tmp_path, monkeypatch):
    rig = Rig(load(sets=["reality.scale=0.0", "recover.first=true"]), tmp_path)
    rig.arm.tcp = replace(rig.arm.tcp, position=np.array(rig.loaded.cell.params(RECOVER).bin))
    program = inserts(rig, monkeypatch)
    rig.gripper.grip(30.0)
    rig.scan()

    def hits():
        rig.gripper.has_peg, rig.gripper.width, rig.arm.force = False, 0.0, np.array([0.0, 0.0, 200.0])

    rig.at(0.1, hits)
    report = rig.command(100)
    assert (report.result, report.part, report.reason) == (Result.FAILURE, PartPlace.BIN, Reason.FORCE_LIMIT)
    assert (program.runs, rig.restocked) == ([], [])


def test_a_hold_while_a_failed_run_brakes_ends_with_the_run(rig, program):
    program.outcome, program.reason = Outcome.FAILURE, Reason.MISSED_GRASP
    moves_for(rig, 0.1)
    rig.at(0.05, lambda: rig.plc.trigger(Control.HOLD))
    told = read(rig, 0.08)
    report = rig.command(CODE)
    assert told[0].state == State.HOLDING
    assert (report.state, report.result, report.progress) == (State.COMPLETE, Result.FAILURE, 100)


@pytest.mark.parametrize(
    "error", [ArmReflexError("arm: reflex"), SkinSilentError("skin: silent"), ValueError("a\nslip"), SystemExit(0)]
)
def test_a_fault_in_a_run_is_reported_until_it_is_cleared(rig, program, error):
    program.fault = error
    report = rig.command(CODE)
    code = error.code if isinstance(error, CellError) else FaultCode.SOFTWARE
    assert (report.state, report.result, report.fault) == (State.ABORTED, Result.FAULT, code)
    row = rig.journal.find(1)
    assert (row.outcome, row.fault, row.stage) == ("fault", code, STAGE)
    assert rig.arm.is_halted
    assert rig.scan().fault == code
    assert (rig.command(CODE).refusal, rig.arm.resets) == (Refusal.NOT_READY, 0)
    cleared = rig.command(Control.CLEAR)
    assert (cleared.state, cleared.fault, cleared.result) == (State.STOPPED, 0, Result.SUCCESS)
    assert rig.command(Control.RESET).state == State.IDLE
    assert rig.arm.resets == 2


def test_a_fault_is_reported_while_the_arm_brakes(rig, program):
    program.fault = ArmReflexError("arm: reflex")
    rig.gripper.grip(30.0)
    moves_for(rig, 0.1)
    told = read(rig, 0.05)
    report = rig.command(CODE)
    assert (told[0].state, told[0].fault, report.state) == (State.ABORTING, FaultCode.ARM_REFLEX, State.ABORTED)
    (row,) = rig.journal.runs(1)
    assert (row.outcome, row.part, row.part_evidence) == ("fault", "in_hand", "hand grips 8.0 mm, switch open")


def test_a_fault_while_idle_aborts_the_cell_and_is_recorded(rig, program):
    rig.arm.fault = ArmReflexError("arm: reflex")
    report = rig.scan(1)
    assert (report.state, report.fault) == (State.ABORTED, FaultCode.ARM_REFLEX)
    assert [event.kind for event in rig.journal.events()].count("fault") == 1


def test_a_reset_with_a_silent_device_aborts_the_cell(rig, program):
    rig.command(Control.STOP)
    rig.skin.fault = SkinSilentError("skin: silent")
    report = rig.command(Control.RESET)
    assert (report.state, report.fault) == (State.ABORTED, FaultCode.SKIN_SILENT)


@pytest.mark.parametrize("error", [ZeroDivisionError("division by zero"), KeyboardInterrupt()])
def test_an_error_of_the_scan_ends_serve_with_a_reported_fault(rig, program, live, monkeypatch, error):
    def fail(stamp):
        raise error

    monkeypatch.setattr(rig.clock, "wait_until", fail)
    with pytest.raises(type(error)):
        rig.supervisor.serve()
    assert (rig.plc.report.state, rig.plc.report.fault) == (State.ABORTED, FaultCode.SOFTWARE)
    assert live.fault.startswith(f"{type(error).__name__}")


@pytest.mark.parametrize(
    ("code", "looks", "fault"), [(CODE, 12, f"{STAGE}: no scan for 0.21 s"), (None, 3000, "scan: no scan for 60.0")]
)
def test_a_blocked_scan_is_reported_at_once_with_the_arm_halted(rig, program, live, looked, code, looks, fault):
    found = []
    runs_on(rig, program)
    rig.at(0.5, lambda: looked.looks(looks, 0.021))
    rig.at(0.5, lambda: found.append((rig.plc.report.state, rig.plc.report.fault, rig.arm.is_halted, live.fault)))
    serve(rig, code)
    assert found[0][:3] == (State.ABORTING, FaultCode.SCAN_OVERRUN, True)
    assert found[0][3].startswith(fault)
    assert rig.supervisor.state is State.ABORTED


def test_only_events_of_a_run_have_its_number(rig, program):
    rig.command(CODE)
    rig.command(Control.STOP)
    events = rig.journal.events()
    assert {event.run for event in events} == {0, 1}
    assert [event.run for event in events if event.kind == "command"] == [0, 0]
    assert json.loads(rig.journal.find(1).stage_times)[0][0] == STAGE


def test_a_silent_plc_is_a_fault_of_its_run(rig, program):
    runs_on(rig, program, 9.0)
    rig.at(0.5, lambda: setattr(rig.plc, "is_alive", False))
    report = rig.command(CODE)
    assert (report.state, report.fault) == (State.ABORTED, FaultCode.PLC_LOST)


class GoneError(BaseException):
    """The end of the process in a test."""


@pytest.mark.parametrize("stuck", ["nothing", "close", "halt"])
def test_a_skill_that_never_returns_ends_the_process_recorded(rig, program, live, looked, monkeypatch, stuck):
    """An arm that neither halts nor closes delays the end by `ENDING` at most."""
    ends, closed, ended, gone = [], [], [], threading.Event()

    def leave(status):
        ends.append((status, live.fault.partition(";")[0]))
        gone.set()
        if threading.current_thread() is threading.main_thread():
            raise GoneError

    monkeypatch.setattr(supervisor.os, "_exit", leave)
    monkeypatch.setattr(rig.arm, "close", lambda: closed.append(rig.arm.is_halted))
    if stuck != "nothing":
        monkeypatch.setattr(supervisor, "ENDING", 0.01)
        act = getattr(rig.arm, stuck)
        monkeypatch.setattr(rig.arm, stuck, lambda: (ended.append(gone.wait(10.0)), act()))
    runs_on(rig, program, 9.0)
    rig.at(0.5, lambda: (rig.supervisor.quit(), looked.looks(120, 0.021)))
    with pytest.raises(GoneError):
        serve(rig, CODE)
    assert ends == [(supervisor.EXIT_BLOCKED, f"{STAGE}: no scan for 0.21 s")] * len(ends)
    assert len(ends) == 1 + (stuck != "nothing")
    assert all(ended)
    assert closed == [True]
    with Journal(rig.folder, is_read_only=True) as journal:
        row = journal.find(1)
    assert (row.outcome, row.fault, row.stage) == ("fault", FaultCode.SCAN_OVERRUN, STAGE)


def test_only_a_simulation_faster_than_real_time_is_not_timed(loaded):
    cell = loaded.cell
    for pace, is_kept in ((1.0, True), ("max", False)):
        simulated = cell.model_copy(update={"sim": cell.sim.model_copy(update={"pace": pace})})
        assert supervisor.is_timed(simulated) is is_kept
        assert supervisor.is_timed(simulated.model_copy(update={"arm": SimpleNamespace(kind="franka")}))
    assert supervisor.is_timed(cell.model_copy(update={"sim": None}))


def test_viewers_see_every_scan_with_its_stage_and_run(rig, program, live):
    rig.scan()
    program.fault = ValueError("a\nslip")
    rig.command(CODE)
    looks = live.take()
    assert {(look.run, look.stage) for look in looks} == {(0, ""), (1, STAGE)}
    assert {look.surface for look in looks} == {rig.loaded.cell.hole.centre[2]}
    assert all(look.seen.stamp <= rig.clock.now() for look in looks)
    assert live.fault == "ValueError: a slip"


def test_a_pulled_cable_is_out_until_it_is_plugged_in(rig, program):
    live = Live()
    rig.cell = replace(rig.cell, cables={"skin": rig.cell.skin})
    rig.supervisor = Supervisor(rig.cell, rig.loaded, rig.bridge, rig.journal, live=live)
    runs_on(rig, program)
    rig.at(0.5, lambda: live.pull(CablePull("skin", True, "page")))
    rig.command(CODE)
    assert (rig.supervisor.state, live.unplugged) == (State.ABORTED, {"skin"})
    live.pull(CablePull("skin", False, "page"))
    live.pull(CablePull("arm", True, "page"))
    rig.command(Control.RESET)
    rig.scan()
    assert (rig.supervisor.state, live.unplugged) == (State.IDLE, frozenset())
    noted = [(e.name, e.source, e.run) for e in rig.journal.events() if e.kind == EventKind.REHEARSAL]
    assert noted == [("skin unplugged", "page", 1), ("skin plugged in", "page", 0)]


def test_the_progress_of_a_run_never_falls(rig, program):
    runs_on(rig, program)
    rig.at(0.4, lambda: [program.context.callbacks.progress(fraction) for fraction in (0.5, 0.2)])
    during = read(rig, 0.6)
    rig.command(CODE)
    assert during[0].progress == 50


@pytest.fixture
def terminal(rig, program):
    """Return a line that gives one command at a time and keeps every answer and report; its cell waits."""
    line = SimpleNamespace(waiting=[], accepted=[], refused=[], reports=[])
    line.poll = lambda: line.waiting.pop(0) if line.waiting else None
    line.publish, line.accept = line.reports.append, line.accepted.append
    line.refuse = lambda *told: line.refused.append(told)
    rig.supervisor = Supervisor(rig.cell, rig.loaded, line, rig.journal)
    rig.scan()
    return line


@pytest.mark.parametrize("code", [Control.FORGET, Control.CLEARED, Control.REFILLED, Control.STOP, Control.ABORT, CODE])
def test_a_command_is_accepted_to_its_sender(rig, terminal, code):
    command = Command(7, code)
    terminal.waiting.append(command)
    rig.scan()
    assert (terminal.accepted, terminal.refused) == ([command], [])
    assert terminal.reports[-1].fault == FaultCode.NONE


class Wall:
    """A wall clock that passes while the supervisor waits, and ends it at a time, s."""

    def __init__(self, end):
        self.time, self.end = 100.0, 100.0 + end

    def monotonic(self):
        return self.time

    def is_set(self):
        return self.time > self.end

    def set(self):
        self.end = self.time

    def wait(self, timeout):
        self.time += timeout


@pytest.mark.parametrize(("takes", "apart"), [(0.3, 1.0), (1.0, 1.0), (2.5, 2.5)])
def test_an_idle_cell_scans_once_a_period_or_without_a_pause(rig, monkeypatch, takes, apart):
    wall, period, ends = Wall(0.5), 1.0 / rig.loaded.cell.scan_rate, []
    monkeypatch.setattr(supervisor, "time", SimpleNamespace(monotonic=wall.monotonic))
    rig.clock.every.append(lambda: wall.wait(takes * period))
    rig.clock.every.append(lambda: ends.append(wall.time))
    Supervisor(rig.cell, rig.loaded, rig.bridge, rig.journal, wall).serve()
    np.testing.assert_allclose(np.diff(ends[:18]), apart * period)


def test_the_preparation_of_a_run_is_no_late_scan(rig, looked, live, monkeypatch):
    inserts(rig, monkeypatch)
    cell = replace(rig.cell, restock=lambda job, seed: looked.looks(40, 0.021))
    rig.supervisor = Supervisor(cell, rig.loaded, rig.bridge, rig.journal, Quit(), live)
    serve(rig, 100)
    assert (rig.plc.report.result, rig.plc.report.fault) == (Result.SUCCESS, FaultCode.NONE)


def test_a_starved_computer_is_no_fault_of_a_simulated_arm(rig, program, live, looked):
    runs_on(rig, program)
    rig.at(0.5, lambda: looked.looks(5, 1.0))
    serve(rig, CODE)
    assert live.fault == ""
