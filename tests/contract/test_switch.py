"""What holds for every success switch; nothing presses the one on the bench."""

from drivers.quantities import SwitchState


def test_switch_that_nothing_presses_is_open(switch_bench):
    switch_bench.device.open()
    assert switch_bench.device.read() is SwitchState.OPEN


def test_reading_never_waits(switch_bench):
    switch_bench.device.open()
    before = switch_bench.clock.now()
    switch_bench.device.read()
    assert switch_bench.clock.now() - before < 0.005


def test_closing_twice_and_opening_again_are_harmless(switch_bench):
    switch_bench.device.open()
    switch_bench.device.close()
    switch_bench.device.close()
    switch_bench.device.open()
    assert switch_bench.device.read() in SwitchState
