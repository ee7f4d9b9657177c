"""Guarantees to a PLC, written once and held over every bus, against the real bridge and supervisor."""

import contextlib
from dataclasses import replace

import pytest

from cell.run.states import State
from drivers.errors import FaultCode, SkinSilentError
from plc_bridge.peer import CellSilentError
from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.messages import Control, LeaseState, Refusal, Result
from plc_bridge.protocol.registers import VERSION, VERSION_MAJOR
from skills.catalogue import GRASP
from skills.contract import Outcome, Reason
from tests.page_user import take_lease
from tests.plc_lines import PLC_LINES
from tests.quick_cell import CODE, STAGE, quick_cell
from tests.trouble import first

PATIENCE = 10.0  # s
FORCE = 0
"""Number of the parameter grasp.force, 0.1 N a count, 1 to 70 N."""


@pytest.fixture(params=PLC_LINES)
def line(request):
    with PLC_LINES[request.param]() as line:
        yield line


@pytest.fixture
def served(line, loaded, tmp_path):
    with quick_cell(loaded, line.plc, tmp_path) as served:
        yield served


@pytest.fixture
def plc(line, served):
    with contextlib.closing(line.connect(served.bridge)) as plc:
        plc.connect()
        yield plc


def in_state(state):
    return lambda report: report.state == state


def begin(plc, served, **what):
    """Start a run that goes on until it is let go, and return the report of its first scans."""
    served.program.may_end.clear()
    plc.trigger(CODE, **what)
    return first(plc.cycle, lambda report: report.state == State.EXECUTE and report.run > 0)


def test_first_number_is_adopted_and_never_run(line, served):
    with contextlib.closing(line.connect(served.bridge)) as plc:
        plc._open()
        plc._image = CommandImage(sequence=7, code=CODE, version=VERSION)
        report = first(plc.cycle, lambda report: report.answered == 7)
        assert (report.refusal, report.result) == (Refusal.ADOPTED, Result.REFUSED)
        assert plc.run(CODE, timeout=PATIENCE).sequence == 8
    assert len(served.program.runs) == 1


def test_a_result_is_held_until_acknowledged_and_never_runs_again(plc, served):
    busy = begin(plc, served)
    assert (busy.answered, busy.sequence, busy.code, busy.result) == (busy.sequence, busy.sequence, CODE, Result.NONE)
    served.program.may_end.set()
    done = plc.wait_for_result(PATIENCE)
    assert (done.result, done.sequence, done.progress) == (Result.SUCCESS, busy.sequence, 100)
    held = [plc.cycle() for _ in range(20)]
    assert {(report.result, report.state) for report in held} == {(Result.SUCCESS, State.COMPLETE)}
    plc.acknowledge()
    assert first(plc.cycle, in_state(State.IDLE)).result == Result.NONE
    for _ in range(20):
        plc.cycle()
        plc._write(plc._image)
    assert plc.read_report().state == State.IDLE
    assert len(served.program.runs) == 1


def test_every_command_is_one_run_with_its_own_answer(plc, served):
    expected = [(Outcome.SUCCESS, Reason.NONE, Result.SUCCESS), (Outcome.FAILURE, Reason.NO_HOLE, Result.FAILURE)] * 2
    sequence = plc.cycle().sequence
    for run, (outcome, reason, result) in enumerate(expected, 1):
        served.program.outcome, served.program.reason = outcome, reason
        report = plc.run(CODE, timeout=PATIENCE)
        assert (report.sequence, report.run, report.result, report.reason) == (sequence + run, run, result, reason)
    assert len(served.program.runs) == len(expected)


REFUSED = [
    ({"code": 99}, Refusal.UNKNOWN_CODE),
    ({"code": CODE, "recipe": 999}, Refusal.UNKNOWN_RECIPE),
    ({"code": Control.UNHOLD}, Refusal.NOT_READY),
]


def test_an_impossible_command_is_refused_and_the_next_runs(plc, served):
    for what, refusal in REFUSED:
        report = plc.run(**what, timeout=PATIENCE)
        assert (report.result, report.refusal) == (Result.REFUSED, refusal)
    assert plc.read_diagnostics().refusals == len(REFUSED)
    assert served.program.runs == []
    assert plc.run(CODE, timeout=PATIENCE).result == Result.SUCCESS


@pytest.mark.parametrize("count", [9, 701])
def test_parameter_beyond_its_limits_is_refused(plc, served, count):
    with contextlib.suppress(CellSilentError):  # where a bus can refuse the value itself, it does
        assert plc.run(CODE, parameters=[(FORCE, count)], timeout=PATIENCE).refusal == Refusal.PARAMETER
    assert served.program.runs == []


def test_parameters_and_serial_number_reach_run_and_record(plc, served, line):
    for count in (10, 700):
        report = plc.run(CODE, 1, f"PEG-{count}", [(FORCE, count)], timeout=PATIENCE)
        assert report.result == Result.SUCCESS
        row = served.record(report.run)
        assert (row.serial, row.recipe, row.sequence) == (f"PEG-{count}", 1, report.sequence)
        assert row.source.startswith(line.source)
    assert [skills[GRASP].force for skills in served.program.runs] == pytest.approx([1.0, 70.0])


def test_plc_of_another_major_version_is_refused(plc, served):
    plc._image = replace(plc._image, version=(VERSION_MAJOR + 1) * 256)
    assert plc.run(CODE, timeout=PATIENCE).refusal == Refusal.VERSION
    assert served.program.runs == []


def test_another_command_while_busy_is_refused_and_the_run_goes_on(plc, served):
    run = begin(plc, served)
    plc.trigger(CODE)
    refused = first(plc.cycle, lambda report: report.refusal != Refusal.NONE)
    assert (refused.answered, refused.refusal) == (run.sequence + 1, Refusal.BUSY)
    served.program.may_end.set()
    done = first(plc.cycle, lambda report: report.result != Result.NONE)
    assert (done.sequence, done.result) == (run.sequence, Result.SUCCESS)
    assert len(served.program.runs) == 1


def test_a_start_needs_the_lease_and_a_stop_does_not(plc, served):
    take_lease(served.bridge)
    report = plc.run(CODE, timeout=PATIENCE)
    assert (report.refusal, report.holder, report.lease) == (Refusal.NOT_HOLDER, "page", LeaseState.TAKEN)
    assert served.program.runs == []
    served.program.may_end.clear()
    served.bridge.submit("page", CommandImage(code=CODE))
    first(plc.read_report, in_state(State.EXECUTE))
    plc.stop()
    report = first(plc.cycle, in_state(State.STOPPED))
    assert report.holder == "page"
    assert served.record(1).outcome == "aborted"


def test_lease_is_taken_shown_and_released(plc, served, line):
    assert plc.take()
    report = plc.cycle()
    assert report.lease == LeaseState.YOURS
    assert report.holder.startswith(line.source)
    assert not take_lease(served.bridge)
    plc.release()
    assert first(plc.cycle, lambda report: report.lease == LeaseState.FREE).holder == ""
    assert take_lease(served.bridge)
    assert not plc.take()


def test_stop_ends_the_own_run_and_reset_makes_ready(plc, served):
    begin(plc, served)
    plc.stop()
    report = plc.wait_for_result(PATIENCE)
    assert (report.result, report.reason) == (Result.ABORTED, Reason.STOPPED)
    plc.acknowledge()
    served.program.may_end.set()
    assert plc.run(CODE, timeout=PATIENCE).refusal == Refusal.NOT_READY
    assert plc.run(Control.RESET, timeout=PATIENCE).result == Result.SUCCESS
    assert plc.run(CODE, timeout=PATIENCE).result == Result.SUCCESS


def test_hold_waits_and_unhold_goes_on(plc, served):
    run = begin(plc, served)
    held = plc.run(Control.HOLD, timeout=PATIENCE)
    assert (held.sequence, held.result) == (run.sequence + 1, Result.SUCCESS)
    assert first(plc.cycle, in_state(State.HELD)).sequence == run.sequence
    served.program.may_end.set()
    assert plc.read_report().transition == Control.HOLD
    assert {plc.cycle().state for _ in range(20)} == {State.HELD}
    plc.trigger(Control.UNHOLD)
    done = first(plc.cycle, lambda report: report.result != Result.NONE)
    assert (done.sequence, done.result) == (run.sequence, Result.SUCCESS)


def test_abort_then_clear_then_reset(plc, served):
    begin(plc, served)
    plc.trigger(Control.ABORT)
    assert first(plc.cycle, in_state(State.ABORTED)).result == Result.ABORTED
    assert plc.read_report().transition == Control.ABORT
    assert plc.run(CODE, timeout=PATIENCE).refusal == Refusal.NOT_READY
    assert plc.run(Control.CLEAR, timeout=PATIENCE).state == State.STOPPED
    assert plc.run(Control.RESET, timeout=PATIENCE).state == State.IDLE
    served.program.may_end.set()
    assert plc.run(CODE, timeout=PATIENCE).result == Result.SUCCESS


def test_a_fault_stays_until_a_reset_also_if_somebody_stops(plc, served):
    served.program.fault = SkinSilentError("nothing heard")
    plc.trigger(CODE)
    report = plc.wait_for_result(PATIENCE)
    assert (report.result, report.fault, report.stage) == (Result.FAULT, FaultCode.SKIN_SILENT, 1)
    assert first(plc.cycle, in_state(State.ABORTED)).fault == FaultCode.SKIN_SILENT
    row = served.record(report.run)
    assert (row.outcome, row.fault, row.stage) == ("fault", FaultCode.SKIN_SILENT, STAGE)
    plc.stop()
    scans = plc.read_report().life
    after = first(plc.cycle, lambda report: (report.life - scans) % 0x10000 > 2)
    assert (after.sequence, after.result, after.refusal) == (report.sequence, Result.FAULT, Refusal.NONE)
    served.program.fault = None
    assert plc.run(Control.RESET, timeout=PATIENCE).fault == FaultCode.NONE
    assert plc.run(CODE, timeout=PATIENCE).result == Result.SUCCESS


def test_life_that_stands_still_stops_the_run_and_frees_the_lease(line, loaded, tmp_path):
    hasty = line.plc.model_copy(update={"life_timeout": 0.5})
    with quick_cell(loaded, hasty, tmp_path) as served, contextlib.closing(line.connect(served.bridge)) as plc:
        plc.connect()
        served.program.may_end.clear()
        plc.trigger(CODE)
        report = first(plc.read_report, in_state(State.ABORTED))
        assert (report.result, report.fault, report.lease) == (Result.FAULT, FaultCode.PLC_LOST, LeaseState.FREE)
        assert plc.read_diagnostics().lost == 1
        assert served.record(1).fault == FaultCode.PLC_LOST


def test_a_run_and_its_result_outlive_the_connection(plc, served, line):
    run = begin(plc, served, serial="PEG-7")
    plc.close()
    with contextlib.closing(line.connect(served.bridge)) as again:
        again._open()
        again._image = CommandImage(sequence=run.sequence, version=VERSION)
        report = again.cycle()
        assert (report.sequence, report.state, report.result) == (run.sequence, State.EXECUTE, Result.NONE)
        served.program.may_end.set()
        done = again.wait_for_result(PATIENCE)
        assert (done.sequence, done.result, done.run) == (run.sequence, Result.SUCCESS, run.run)
        again.acknowledge()
        assert first(again.cycle, in_state(State.IDLE)).result == Result.NONE
        assert again.run(CODE, timeout=PATIENCE).sequence == run.sequence + 1
    assert len(served.program.runs) == 2
