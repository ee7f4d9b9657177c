"""Contract of every success switch; nothing presses the one on the bench at first."""

import pytest

from drivers.quantities import SwitchState

ANSWER_TIME = 0.05
"""Longest time from the edge to the answer, s: five scans."""


def wait(bench, time):
    """Read in every scan for `time`, s, and return the last state."""
    end = bench.clock.now() + time
    while bench.clock.now() < end:
        bench.clock.wait_until(min(bench.clock.now() + 0.01, end))
        bench.device.read()
    return bench.device.read()


def press(bench, pressed):
    if bench.press is None:
        pytest.skip("needs a hand at the lever")
    bench.press(pressed)


def test_an_untouched_switch_is_open_also_when_opened_again(switch_bench):
    switch_bench.device.open()
    before = switch_bench.clock.now()
    assert switch_bench.device.read() is SwitchState.OPEN
    assert switch_bench.clock.now() - before < 0.005
    assert {wait(switch_bench, ANSWER_TIME) for _ in range(20)} == {SwitchState.OPEN}
    switch_bench.device.close()
    switch_bench.device.close()
    for _ in range(2):
        switch_bench.device.open()
    assert switch_bench.device.read() is SwitchState.OPEN


def test_pressed_is_closed_and_released_is_open_again(switch_bench):
    switch_bench.device.open()
    for pressed, state in ((True, SwitchState.CLOSED), (False, SwitchState.OPEN), (True, SwitchState.CLOSED)):
        press(switch_bench, pressed)
        assert wait(switch_bench, ANSWER_TIME) is state


def test_switch_that_is_pressed_from_the_start_is_closed(switch_bench):
    press(switch_bench, True)
    wait(switch_bench, ANSWER_TIME)
    switch_bench.device.open()
    assert wait(switch_bench, ANSWER_TIME) is SwitchState.CLOSED
