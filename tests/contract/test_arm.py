"""Contract of every arm; the one on the bench stands still in free space."""

import math

import numpy as np
import pytest

from tests.setpoints import risen


@pytest.fixture
def opened(arm_bench):
    arm_bench.device.open()
    arm_bench.clock.wait_until(arm_bench.clock.now() + 0.2)
    return arm_bench


def test_state_is_whole_and_of_now(opened):
    state = opened.device.read()
    assert (state.q.shape, state.dq.shape, state.wrench.force.shape) == ((7,), (7,), (3,))
    assert state.stamp == pytest.approx(opened.clock.now(), abs=0.01)
    assert state.commanded is None or (state.commanded.shape == (7,) and np.isfinite(state.commanded).all())
    assert state.unexplained is None or (state.unexplained.shape == (7,) and np.isfinite(state.unexplained).all())
    assert np.allclose(state.tcp.rotation.T @ state.tcp.rotation, np.eye(3), atol=1e-9)


def test_an_arm_stands_still_but_for_a_setpoint_until_it_is_halted(opened):
    arm, clock = opened.device, opened.clock

    def moved(seconds):
        before = arm.read().tcp.position
        clock.wait_until(clock.now() + seconds)
        return arm.read().tcp.position - before

    assert np.linalg.norm(moved(1.0)) < 1e-3
    assert arm.read().setpoint_age == math.inf
    start = arm.read().tcp.position
    arm.follow(risen(arm.read(), 0.02, clock.now() + 10.0))
    moved(2.0)
    assert (arm.read().tcp.position - start)[2] > 0.01
    arm.follow(risen(arm.read(), -0.02, clock.now() + 10.0))
    moved(0.2)
    arm.halt()
    arm.halt()
    moved(0.5)
    assert np.linalg.norm(moved(1.0)) < 1e-3


def test_reset_and_closing_twice_are_harmless(opened):
    opened.device.reset()
    opened.device.read()
    opened.device.close()
    opened.device.close()
