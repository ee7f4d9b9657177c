"""Contract of every gripper; nothing is between the fingers of the one on the bench."""

import pytest

WIDTH = 0.03


def wait_for_rest(bench, longest=5.0):
    end = bench.clock.now() + longest
    while bench.device.read().is_moving and bench.clock.now() < end:
        bench.clock.wait_until(bench.clock.now() + 0.05)
    return bench.device.read()


@pytest.fixture
def released(gripper_bench):
    """Yield the bench after its gripper was opened and commanded to open its fingers."""
    gripper_bench.device.open()
    gripper_bench.device.release(WIDTH)
    wait_for_rest(gripper_bench)
    return gripper_bench


def test_fingers_go_to_the_width_that_they_are_told(released):
    state = released.device.read()
    assert state.width == pytest.approx(WIDTH, abs=0.001)
    assert (state.is_gripping, state.is_moving) == (False, False)


def test_repeating_a_command_is_harmless(released):
    released.device.release(WIDTH)
    released.clock.wait_until(released.clock.now() + 0.1)
    assert released.device.read().width == pytest.approx(WIDTH, abs=0.001)


def test_fingers_that_meet_hold_nothing(released):
    released.device.grip(20.0)
    state = wait_for_rest(released)
    assert not state.is_gripping
    assert state.width < 0.002
    released.device.release(WIDTH)
    assert wait_for_rest(released).width == pytest.approx(WIDTH, abs=0.001)


def test_closing_twice_is_harmless(released):
    released.device.close()
    released.device.close()
