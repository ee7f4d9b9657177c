"""Every register is correct at the moment at which the PLC reads it: numbers on a wire, against the real bridge and supervisor."""

import pytest

from cell.run.states import State
from plc_bridge.protocol.messages import Control, Refusal, Result
from tests.plc_wire import block, stopped
from tests.quick_cell import CODE


def test_a_start_before_a_reset_in_one_segment_is_refused(plc, served):
    stopped(plc)
    plc.order((3, CODE), (4, Control.RESET))
    plc.until(lambda report: report.state == State.IDLE)
    assert served.program.runs == []


def test_the_first_answer_to_a_start_that_cannot_be_is_its_refusal(plc):
    stopped(plc)
    for sequence in range(3, 13):
        plc.order((sequence, CODE))
        report = plc.answer(sequence)
        assert (report.refusal, report.sequence, report.result) == (Refusal.NOT_READY, sequence, Result.REFUSED)


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
