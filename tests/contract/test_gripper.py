"""Contract of every gripper; nothing is between the fingers of the one on the bench."""

import pytest

WIDTH = 0.03


def wait_for_rest(bench):
    end = bench.clock.now() + 5.0
    while bench.device.read().is_moving and bench.clock.now() < end:
        bench.clock.wait_until(bench.clock.now() + 0.05)
    return bench.device.read()


def test_fingers_reach_their_width_and_grip_nothing_if_they_meet(gripper_bench):
    device = gripper_bench.device
    device.open()
    for _ in range(2):  # a command that is repeated is harmless
        device.release(WIDTH)
        state = wait_for_rest(gripper_bench)
        assert state.width == pytest.approx(WIDTH, abs=0.001)
        assert (state.is_gripping, state.is_moving) == (False, False)
    device.grip(20.0)
    state = wait_for_rest(gripper_bench)
    assert not state.is_gripping
    assert state.width < 0.002
    device.release(WIDTH)
    assert wait_for_rest(gripper_bench).width == pytest.approx(WIDTH, abs=0.001)
    device.close()
    device.close()
