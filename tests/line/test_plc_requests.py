"""Answers to single requests of a PLC, words and bits on a wire, against the real bridge and supervisor.

`tests/unit/plc_bridge/test_rough_line.py` has a ladder in random order beside other clients.
"""

import struct

import pytest

from cell.run.states import State
from plc_bridge.protocol.images import PACKML, CommandImage
from plc_bridge.protocol.messages import Control, Refusal, Result
from tests.plc_wire import block, ladder, stopped, until_bits
from tests.quick_cell import CODE
from tests.trouble import until


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


def test_a_torn_block_with_the_last_stop_is_not_answered_as_that(plc):
    block(plc, life=1, sequence=1)
    block(plc, life=2, sequence=2, code=Control.STOP)
    plc.until(lambda report: report.state == State.STOPPED)
    block(plc, life=3, sequence=3, code=Control.STOP, life_tail=2)
    block(plc, life=3, sequence=3, code=CODE)
    report = plc.answer(3)
    assert (report.refusal, report.result) == (Refusal.NOT_READY, Result.REFUSED)


def test_execute_that_is_1_in_its_first_write_is_an_error(plc, served):
    ladder(plc)
    plc.coil("execute", 1)
    assert (plc.bits(), plc.report().refusal) == ({"error"}, Refusal.ADOPTED)
    plc.coil("execute", 0)
    assert plc.bits() == set()
    plc.coil("execute", 1)
    until_bits(plc, "done")
    assert len(served.program.runs) == 1


@pytest.mark.parametrize("is_closed", [False, True])
def test_nothing_starts_or_resets_until_the_stop_coil_falls(plc, connect, served, is_closed):
    """It falls by itself or with its connection."""
    other = connect()
    plc.order((1, Control.NONE))
    other.coil("stop", 1)
    plc.until(lambda report: report.state == State.STOPPED)
    for sequence, code in enumerate((CODE, Control.RESET, Control.CLEAR, Control.UNHOLD), 2):
        plc.order((sequence, code))
        report = plc.answer(sequence)
        assert (report.refusal, report.result, report.state) == (Refusal.STOP_HELD, Result.REFUSED, State.STOPPED)
    served.bridge.opened("page", "page")
    assert served.bridge.submit("page", CommandImage(code=Control.RESET)) is Refusal.STOP_HELD
    assert served.program.runs == []
    if is_closed:
        other.close()
        until(lambda: served.bridge.diagnostics.connections == 1)
    else:
        other.coil("stop", 0)
    plc.order((6, Control.RESET), (7, CODE))
    assert plc.until(lambda report: report.sequence == 7 and report.result != Result.NONE).result == Result.SUCCESS


def test_pack_tags_are_read_whole_and_one_by_one(plc):
    stopped(plc)
    whole, one = plc.ask(
        struct.pack(">BHH", 4, PACKML.start, PACKML.words), struct.pack(">BHH", 4, PACKML.start + 1, 1)
    )
    assert PACKML.unpack(struct.unpack(f">{PACKML.words}H", whole[2:]))["packml_state"] == State.STOPPED
    assert one[2:] == struct.pack(">H", State.STOPPED)
