"""Contract of every arm; the one on the bench stands still in free space."""

import math

import numpy as np
import pytest

from drivers.quantities import ImpedanceSetpoint

STIFFNESS = np.array([1500.0, 1500.0, 1500.0, 60.0, 60.0, 60.0])


@pytest.fixture
def opened(arm_bench):
    """Yield the bench with its arm open and at rest."""
    arm_bench.device.open()
    arm_bench.clock.wait_until(arm_bench.clock.now() + 0.2)
    return arm_bench


def setpoint(bench, offset=(0.0, 0.0, 0.0), valid=10.0, number=1):
    """Return what holds the arm where it is, moved by `offset`."""
    state = bench.device.read()
    return ImpedanceSetpoint(
        id=number,
        tip=state.tcp.position + np.array(offset),
        axis=-state.tcp.rotation[:, 0],
        stiffness=STIFFNESS,
        damping_ratio=np.ones(6),
        valid_until=bench.clock.now() + valid,
    )


def test_state_is_whole_and_of_now(opened):
    state = opened.device.read()
    assert (state.q.shape, state.dq.shape, state.wrench.force.shape) == ((7,), (7,), (3,))
    assert state.stamp == pytest.approx(opened.clock.now(), abs=0.01)
    assert state.commanded is None or (state.commanded.shape == (7,) and np.isfinite(state.commanded).all())
    assert state.unexplained is None or (state.unexplained.shape == (7,) and np.isfinite(state.unexplained).all())
    assert np.allclose(state.tcp.rotation.T @ state.tcp.rotation, np.eye(3), atol=1e-9)


def test_an_arm_stands_still_until_it_is_told_a_setpoint_goes_towards_it_and_stands_still_once_halted(opened):
    def moved(seconds):
        before = opened.device.read().tcp.position
        opened.clock.wait_until(opened.clock.now() + seconds)
        return opened.device.read().tcp.position - before

    assert np.linalg.norm(moved(1.0)) < 1e-3
    assert opened.device.read().setpoint_age == math.inf
    start = opened.device.read().tcp.position
    opened.device.follow(setpoint(opened, (0.0, 0.0, 0.02)))
    moved(2.0)
    assert (opened.device.read().tcp.position - start)[2] > 0.01
    opened.device.follow(setpoint(opened, (0.0, 0.0, -0.02)))
    moved(0.2)
    opened.device.halt()
    opened.device.halt()
    moved(0.5)
    assert np.linalg.norm(moved(1.0)) < 1e-3


def test_reset_and_closing_twice_are_harmless(opened):
    opened.device.reset()
    opened.device.read()
    opened.device.close()
    opened.device.close()
