"""Answers to a PLC stay correct on a disturbed line; `tests.rough_line` lists the conditions."""

import logging

import pytest

from plc_bridge.protocol.messages import Control, Result
from tests.plc_bytes import Tcp, word
from tests.rough_line import ACKNOWLEDGE, CLIENTS, Line, steps, walk

STEPS, SEEDS = 25_000, range(1, 5)


@pytest.fixture(autouse=True)
def quiet(caplog):
    """Log nothing about clients that misbehave."""
    caplog.set_level(logging.CRITICAL)


def settle(line: Line) -> None:
    """When everybody has left, a newcomer's command runs, is answered, and leaves the cell ready."""
    for plc in line.plcs:
        plc.release_stop(1)
    line.cell.wait(3.0)
    line.cell.end()
    plc = Tcp(line.cell, "10.0.0.99")
    plc.write((0, 40, 0), (0, 41, Control.CLEAR))
    line.cell.scan()
    plc.write((0, 42, Control.RESET))
    line.cell.scan()
    plc.write((0, 43, 100))
    line.cell.scan()
    line.cell.end(Result.FAILURE)
    assert (plc.report().sequence, plc.report().result) == (43, Result.FAILURE)
    plc.ask(word(ACKNOWLEDGE, 43))
    assert plc.report().result == Result.NONE


@pytest.mark.parametrize("seed", SEEDS)
def test_100000_random_steps_give_no_false_answer(seed):
    _, why, line = walk(steps(seed, STEPS))
    assert why == "", "\n".join(line.sent[-60:])
    assert len({name for name, result in line.seen if result == "SUCCESS"}) >= CLIENTS - 2
    settle(line)


def test_a_fault_of_the_rules_is_found(monkeypatch):
    monkeypatch.setattr("plc_bridge.protocol.sequence_numbers.SequenceNumbers.forget", lambda self: None)
    monkeypatch.setattr("plc_bridge.protocol.sequence_numbers._Count.had", lambda *_: False)
    assert walk(steps(1, STEPS))[1]
