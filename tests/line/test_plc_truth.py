"""Every register is correct at the moment at which the PLC reads it: numbers on a wire, against the real bridge and supervisor."""

import struct

import pytest

from cell.run.states import State
from plc_bridge.protocol.messages import Control, LeaseState, Refusal, Result
from tests.plc_wire import block, stopped
from tests.quick_cell import CODE

# One order from the wire to the scan.


def test_a_start_before_a_reset_in_one_segment_is_refused(plc, served):
    stopped(plc)
    plc.order((3, CODE), (4, Control.RESET))
    plc.until(lambda report: report.state == State.IDLE)
    assert served.program.runs == []


def test_a_hold_behind_a_start_in_one_segment_holds_the_run(plc, served):
    served.program.may_end.clear()
    plc.order((1, Control.NONE), (2, CODE), (3, Control.HOLD))
    plc.until(lambda report: report.state == State.HELD)


def test_a_stop_overtakes_the_start_before_it(plc, served):
    plc.order((1, Control.NONE), (2, CODE), (3, Control.STOP))
    plc.until(lambda report: report.state == State.STOPPED)
    assert served.program.runs == []


# Answers are true at once.


@pytest.mark.parametrize("sequence", range(3, 13))
def test_the_first_answer_to_a_start_that_cannot_be_is_its_refusal(plc, sequence):
    stopped(plc)
    plc.order((sequence, CODE))
    report = plc.answer(sequence)
    assert (report.refusal, report.sequence, report.result) == (Refusal.NOT_READY, sequence, Result.REFUSED)


def test_a_control_that_cannot_be_is_refused_by_its_first_answer_and_the_run_goes_on(plc, served):
    served.program.may_end.clear()
    plc.order((1, Control.NONE), (2, CODE))
    plc.until(lambda report: report.state == State.EXECUTE)
    plc.order((3, Control.UNHOLD))
    report = plc.answer(3)
    assert (report.refusal, report.sequence, report.result) == (Refusal.NOT_READY, 2, Result.NONE)


def test_what_belongs_to_another_run_never_stands_beside_the_own_result(plc, connect, served):
    plc.order((1, Control.NONE), (2, CODE))
    own = plc.until(lambda report: report.result == Result.SUCCESS)
    plc.ask(struct.pack(">BHH", 6, 5, 3))
    other = connect()
    other.order((1, Control.NONE), (9, CODE))
    assert other.until(lambda report: report.result == Result.SUCCESS).run == own.run + 1
    again = plc.report()
    assert (again.sequence, again.result, again.run, again.stage_times) == (2, Result.SUCCESS, own.run, own.stage_times)


# Torn writes, and whose run it is.


@pytest.mark.parametrize("code", [Control.STOP, Control.ABORT])
def test_a_stop_by_code_passes_although_the_block_is_torn(plc, served, code):
    served.program.may_end.clear()
    block(plc, life=1, sequence=1)
    block(plc, life=2, sequence=2, code=CODE)
    plc.until(lambda report: report.state == State.EXECUTE)
    block(plc, life=3, sequence=3, code=code, life_tail=2)
    report = plc.until(lambda report: report.result != Result.NONE)
    assert (report.sequence, report.result) == (2, Result.ABORTED)


def test_a_torn_stop_is_answered_once_its_block_is_whole(plc):
    block(plc, life=1, sequence=1)
    block(plc, life=2, sequence=2, code=Control.STOP, life_tail=1)
    plc.until(lambda report: report.state == State.STOPPED)
    assert plc.report().answered == 1
    block(plc, life=2, sequence=2, code=Control.STOP)
    assert (plc.answer(2).refusal, plc.report().result) == (Refusal.NONE, Result.SUCCESS)


def test_a_torn_block_whose_code_is_the_last_stop_is_not_answered_as_if_it_were_that(plc, served):
    block(plc, life=1, sequence=1)
    block(plc, life=2, sequence=2, code=Control.STOP)
    plc.until(lambda report: report.state == State.STOPPED)
    block(plc, life=3, sequence=3, code=Control.STOP, life_tail=2)
    block(plc, life=3, sequence=3, code=CODE)
    report = plc.answer(3)
    assert (report.refusal, report.result) == (Refusal.NOT_READY, Result.REFUSED)


def test_an_hmi_beside_the_plc_does_not_inherit_its_run(connect, served):
    served.program.may_end.clear()
    plc, hmi = connect(), connect()
    hmi.order((7, Control.NONE))
    plc.order((1, Control.NONE), (2, CODE))
    run = plc.until(lambda report: report.state == State.EXECUTE)
    plc.close()
    late = connect()
    for wire, number in ((hmi, 8), (late, 9)):
        wire.order((number, Control.NONE))
        report = wire.report()
        assert (report.sequence, report.lease) == (number, LeaseState.TAKEN)
    again = connect()
    again.order((2, CODE))
    served.program.may_end.set()
    report = again.until(lambda report: report.result != Result.NONE)
    assert (report.sequence, report.result, report.run) == (2, Result.SUCCESS, run.run)
    assert report.lease == LeaseState.YOURS
