import numpy as np
import pytest

from cell.config.files import arm_file
from drivers import impedance
from drivers.arm import dynamics, inertia
from drivers.arm.inertia import joint_inertia, tip_inertia
from drivers.arm.kinematics import jacobian
from drivers.arm.link import holding_words
from drivers.arm.model import read_arm

STIFFNESS = np.array([1500.0, 1500.0, 600.0, 40.0, 40.0, 40.0])


@pytest.fixture(params=["panda", "fr3", "fr3v2"])
def arm(request):
    return read_arm(arm_file(request.param))


@pytest.fixture(params=[0.0, 0.4])
def q(request, arm):
    return np.array(arm.home) + request.param * np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0])


def compiled(arm, q):
    figures = impedance.figures(arm)
    rotations, origins = impedance.links(figures, q)
    return dynamics.joint_inertia(figures[impedance.MASSES :], rotations, origins)


def test_the_loops_inertia_is_that_of_the_plain_one_in_joints_and_at_the_tip(arm, q):
    length, made = 0.05, compiled(arm, q)
    np.testing.assert_allclose(made, joint_inertia(arm, q) + np.diag(arm.joints.rotor_inertia), rtol=1e-12, atol=1e-12)
    position, finger, axes, origins = impedance.forward(impedance.figures(arm), q)
    J = jacobian(position + length * finger[:, 0], axes, origins)
    np.testing.assert_allclose(dynamics.inertia_at(made, J), tip_inertia(arm, q, length), rtol=1e-9)


def test_the_geometric_mean_is_what_lies_between_two_matrices(arm, q):
    A, B = tip_inertia(arm, q, 0.05), np.diag(STIFFNESS)
    G = dynamics.geometric_mean(A, B)
    np.testing.assert_allclose(G @ np.linalg.solve(A, G), B, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("module", [dynamics, inertia], ids=["compiled", "numpy"])
def test_no_mode_of_a_critically_damped_tip_swings_or_creeps(arm, q, module):
    """Of s² L + s D + K every root is real, and each mode has its two roots at the same place."""
    L = tip_inertia(arm, q, 0.05)
    D = module.critical_damping(L, STIFFNESS)
    inverse = np.linalg.inv(L)
    flow = np.block([[np.zeros((6, 6)), np.eye(6)], [-inverse @ np.diag(STIFFNESS), -inverse @ D]])
    rates = np.sqrt(np.linalg.eigvals(inverse @ np.diag(STIFFNESS)).real)
    roots = np.linalg.eigvals(flow)
    # A double root is as exact as the root of the arithmetic.
    np.testing.assert_allclose(np.sort(-roots.real), np.sort(np.repeat(rates, 2)), rtol=1e-2)
    assert np.abs(roots.imag).max() < 1e-2 * rates.max()


def test_the_damping_does_not_depend_on_the_units_that_stiffness_comes_in(arm, q):
    L = tip_inertia(arm, q, 0.05)
    np.testing.assert_allclose(
        dynamics.critical_damping(L, 100.0 * STIFFNESS), 10.0 * dynamics.critical_damping(L, STIFFNESS), rtol=1e-4
    )


def test_a_direction_without_stiffness_is_hardly_damped_and_the_others_are_as_before(arm, q):
    L = tip_inertia(arm, q, 0.05)
    loose = dynamics.critical_damping(np.diag(np.diag(L)), np.array([*STIFFNESS[:5], 0.0]))
    whole = dynamics.critical_damping(np.diag(np.diag(L)), STIFFNESS)
    assert 0.0 < loose[5, 5] < 0.1 * whole[5, 5]
    np.testing.assert_allclose(np.diag(loose)[:5], np.diag(whole)[:5], rtol=1e-4)


def test_an_arm_that_is_stretched_out_is_damped_without_an_error(arm):
    state, rates = impedance.new_state(arm), np.full(7, 0.1)
    tau = impedance.torque(impedance.figures(arm), holding_words(), state, np.zeros(7), rates, 0.0, 1e-3)
    assert np.isfinite(tau).all()
