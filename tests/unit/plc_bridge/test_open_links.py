"""Stops, freezes and joined connections as bytes; restarts, late and repeated blocks are in test_rough_line."""

import pytest

from plc_bridge.protocol.messages import Control, Refusal, Result
from tests.plc_bytes import Can, Cell, Tcp, coil, word

SHARE = word(5, 2)


@pytest.fixture
def cell():
    return Cell()


def seated(cell, plc, number=3, life=0):
    """Let a program under `number` succeed; the PLC has not read the end."""
    step = bool(life)
    plc.write((life, number - 1, 0), (life + step, number, 100))
    cell.scan()
    cell.end()
    report = plc.report()
    assert (report.sequence, report.result, report.run) == (number, Result.SUCCESS, 1)


def told(report):
    return report.sequence, report.result, report.answered, report.refusal


def test_a_stop_that_is_repeated_unchanged_is_one_event(cell):
    plc, other = Tcp(cell), Tcp(cell, "10.0.0.2")
    plc.write((1, 9, 0), (2, 10, 100), (3, 8, 3))
    cell.scan()
    other.write((1, 1, 0), (2, 2, 1))
    plc.ask(word(5, 3))
    other.write((3, 3, 1))
    cell.scan()
    assert cell.report.state == 4
    plc.write((3, 8, 3), (4, 8, 3))
    cell.scan()
    assert cell.report.state == 4


def test_a_finished_result_outlives_the_operational_state(cell):
    plc = Can(cell)
    seated(cell, plc, life=1)
    plc.nmt(2)
    plc.nmt(1)
    assert told(plc.write((3, 3, 100))) == (3, Result.SUCCESS, 3, Refusal.NONE)


def test_each_of_two_joined_links_has_its_own_stop(cell):
    one, other = Tcp(cell), Tcp(cell)
    for each in (one, other):
        each.ask(SHARE)
    one.write((0, 1, 0))
    other.ask(coil(1, True))
    one.ask(bytes.fromhex("0F 0000 0003 01 00"))
    cell.scan()
    assert told(one.write((0, 2, Control.RESET)))[2:] == (2, Refusal.STOP_HELD)
    assert told(one.write((0, 3, 100)))[2:] == (3, Refusal.STOP_HELD)
    assert cell.bridge.diagnostics.stops_held == 1
    other.close()
    assert cell.bridge.diagnostics.stops_held == 0


def test_a_stop_goes_with_its_connection_into_the_joined_link(cell):
    one, other = Tcp(cell), Tcp(cell)
    one.ask(coil(1, True))
    one.ask(SHARE)
    other.ask(SHARE)
    assert (one.ask(bytes.fromhex("01 0001 0001"))[2], other.ask(bytes.fromhex("01 0001 0001"))[2]) == (1, 0)
    assert cell.bridge.diagnostics.stops_held == 1


def test_a_new_connection_does_not_find_the_run_of_the_program_before(cell):
    plc, other = Tcp(cell), Tcp(cell, "10.0.0.2")
    seated(cell, plc, number=1)
    other.ask(coil(1, True))
    plc.write((0, 0, 0))
    assert told(plc.write((0, 1, 100)))[2:] == (1, Refusal.STOP_HELD)
    plc.close()
    plc.open()
    assert told(plc.write((0, 1, 100))) == (1, Result.REFUSED, 1, Refusal.ADOPTED)
