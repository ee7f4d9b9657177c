"""Contract of every arm; the one on the bench stands still in free space."""

import math

import numpy as np
import pytest

from drivers.quantities import ImpedanceSetpoint

STIFFNESS = np.array([1500.0, 1500.0, 1500.0, 60.0, 60.0, 60.0])
DAMPING = np.array([90.0, 90.0, 90.0, 6.0, 6.0, 6.0])


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


def test_arm_that_was_told_nothing_stands_still_and_holds_nothing(opened):
    before = opened.device.read().tcp.position
    opened.clock.wait_until(opened.clock.now() + 1.0)
    state = opened.device.read()
    assert np.linalg.norm(state.tcp.position - before) < 1e-3
    assert state.setpoint_age == math.inf


def test_arm_goes_towards_its_setpoint(opened):
    start, wanted = opened.device.read().tcp.position, setpoint(opened, (0.0, 0.0, 0.02))
    opened.device.follow(wanted)
    opened.clock.wait_until(opened.clock.now() + 2.0)
    assert (opened.device.read().tcp.position - start)[2] > 0.01


def test_halted_arm_stands_still(opened):
    opened.device.follow(setpoint(opened, (0.0, 0.0, 0.02)))
    opened.clock.wait_until(opened.clock.now() + 0.2)
    opened.device.halt()
    opened.device.halt()
    opened.clock.wait_until(opened.clock.now() + 0.5)
    before = opened.device.read().tcp.position
    opened.clock.wait_until(opened.clock.now() + 1.0)
    assert np.linalg.norm(opened.device.read().tcp.position - before) < 1e-3


def test_reset_and_closing_twice_are_harmless(opened):
    opened.device.reset()
    opened.device.read()
    opened.device.close()
    opened.device.close()
