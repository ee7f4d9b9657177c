import mujoco
import numpy as np
import pytest

from cell.config.files import arm_file
from drivers import impedance
from drivers.arm.inertia import joint_inertia, tip_inertia
from drivers.arm.model import read_arm
from sim.arm.arm_truth import ideal
from sim.contact import cylinder
from sim.contact.plate import Plate
from sim.world import scene


@pytest.fixture(params=["panda", "fr3", "fr3v2"])
def arm(request):
    return read_arm(arm_file(request.param))


@pytest.fixture(params=[0.0, 0.4])
def q(request, arm):
    return np.array(arm.home) + request.param * np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0])


def test_the_arms_inertia_is_that_of_the_physics(arm, q, loaded):
    cylinder.install()
    plate = Plate(np.zeros(3), np.eye(3), (0.004, 0.004), 0.02)
    model = scene.held_model(ideal(arm), loaded.cell.job(), plate, 0.1, 5e-4)
    data = mujoco.MjData(model)
    for name in (scene.GRIP, "peg"):
        held = model.body(name).id
        model.body_mass[held] = model.body_inertia[held] = 0.0
    data.qpos[:7] = q
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    np.testing.assert_allclose(joint_inertia(arm, q), M[:7, :7], rtol=1e-9, atol=1e-9)


def test_a_push_at_the_tip_moves_it_as_its_inertia_says(arm, q):
    length, push = 0.05, np.array([3.0, -2.0, 1.0, 0.1, 0.2, -0.1])
    position, finger, axes, origins = impedance.forward(impedance.figures(arm), q)
    tip = position + length * finger[:, 0]
    J = np.vstack([np.cross(axes, tip - origins).T, axes.T])
    M = joint_inertia(arm, q) + np.diag(arm.joints.rotor_inertia)
    acceleration = J @ np.linalg.solve(M, J.T @ push)
    np.testing.assert_allclose(tip_inertia(arm, q, length) @ acceleration, push, atol=1e-9)
