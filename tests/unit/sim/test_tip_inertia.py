import mujoco
import numpy as np
import pytest

from drivers import impedance
from sim.tip_inertia import joint_inertia, tip_inertia
from sim.world import World


@pytest.fixture
def world(loaded):
    config = loaded.cell
    return World(config.sim, config.contact, config.grip, config.skin.layout, config.job())


def test_the_arms_inertia_is_that_of_the_physics(world):
    model, data = world.physics()
    fingers = model.body("left").mass[0] + model.body("right").mass[0]
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    # The fingers are points at the hand in the one, bodies of their own in the other: 30 g, a hand's breadth away.
    assert fingers == pytest.approx(0.03)
    np.testing.assert_allclose(joint_inertia(world.q), M[:7, :7], atol=2e-3)


def test_a_push_at_the_tip_moves_it_as_its_inertia_says(world):
    q, length, push = world.q, 0.05, np.array([3.0, -2.0, 1.0, 0.1, 0.2, -0.1])
    position, finger, axes, origins = impedance.forward(q)
    tip = position + length * finger[:, 0]
    J = np.vstack([np.cross(axes, tip - origins).T, axes.T])
    acceleration = J @ np.linalg.solve(joint_inertia(q), J.T @ push)
    np.testing.assert_allclose(tip_inertia(q, length) @ acceleration, push, atol=1e-9)
