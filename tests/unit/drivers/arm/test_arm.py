"""The arms that ship: their files, kinematics and inertia, and the damping that follows."""

import re

import mujoco
import numpy as np
import pytest

from cell.config.files import ARMS, arm_file
from drivers import impedance
from drivers.arm import dynamics, inertia
from drivers.arm.franka_wire import wrench_on_hand
from drivers.arm.inertia import joint_inertia, tip_inertia
from drivers.arm.kinematics import jacobian, joints_at, links
from drivers.arm.link import holding_words
from drivers.arm.model import read_arm
from drivers.errors import ConfigError
from drivers.frames import UP
from drivers.part.round import Round
from sim.arm.arm_truth import ideal
from sim.contact import shapes
from sim.contact.plate import Plate
from sim.world import scene

SHIPPED = sorted(ARMS.glob("*.toml"))


def test_every_shipped_arm_is_plausible_and_names_its_sources():
    arms = [read_arm(file) for file in SHIPPED]
    assert len({arm.name for arm in arms}) == len(arms) >= 2
    assert all(10.0 < sum(link.mass for link in arm.link) < 25.0 for arm in arms)
    assert all("Source" in file.read_text(encoding="utf-8").split("name =")[0] for file in SHIPPED)


def test_the_second_finger_is_the_first_after_half_a_turn():
    finger = read_arm(arm_file("fr3")).hand.finger
    turn = np.diag([-1.0, -1.0, 1.0])
    np.testing.assert_allclose(finger.turned().com, turn @ finger.com)
    np.testing.assert_allclose(finger.turned().tensor(), turn @ finger.tensor() @ turn.T)


@pytest.mark.parametrize(
    ("line", "wrong", "told"),
    [
        ("stroke = 0.08", "stroke = 80.0", "hand.stroke"),
        ("elbow = 3", "elbow = 8", "kinematics.elbow"),
        ("flange = 0.107", "", "kinematics.flange"),
        ("inertia = [0.70337,", "inertia = [-0.70337,", "not positive definite"),
        ("q_min = [-2.8973,", "q_min = [2.8973,", "q_min of joint 1"),
        ("home = [-0.45,", "home = [-3.0,", "home of joint 1 = -3.0: -2.8973 to 2.8973 allowed"),
        ("alpha = [0.0,", "alpha = [", "kinematics.alpha"),
        ("[joints]", "[joints", "not TOML"),
    ],
)
def test_implausible_figures_of_an_arm_are_refused_in_one_line(tmp_path, line, wrong, told):
    text = arm_file("panda").read_text(encoding="utf-8")
    assert line in text
    file = tmp_path / "bent.toml"
    file.write_text(text.replace(line, wrong), encoding="utf-8")
    with pytest.raises(ConfigError, match=rf"\A{re.escape(str(file))}: [^\n]*{re.escape(told)}[^\n]*\Z"):
        read_arm(file)


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_the_hand_is_never_further_from_the_shoulder_than_the_reach(file):
    arm, rng = read_arm(file), np.random.default_rng(1)
    words = impedance.figures(arm)
    joints = rng.uniform(arm.joints.q_min, arm.joints.q_max, (500, 7))
    distances = [np.linalg.norm(impedance.forward(words, q)[0] - arm.shoulder()) for q in joints]
    assert 0.8 * arm.reach() < max(distances) < arm.reach()


def test_fingers_of_ones_own_are_stated_over_a_shipped_arm(tmp_path):
    file, shipped = tmp_path / "own.toml", read_arm(arm_file("fr3"))
    own = "finger = { mass = 0.05, com = [0.0, 0.01, -0.02], inertia = [1e-5, 1e-5, 1e-6, 0.0, 0.0, 0.0] }"
    file.write_text(f'base = "{arm_file("fr3")}"\n[hand]\nstroke = 0.07\n{own}\n', encoding="utf-8")
    arm = read_arm(file)
    assert (arm.hand.stroke, arm.hand.finger.mass) == (0.07, 0.05)
    assert (arm.hand.body, arm.link) == (shipped.hand.body, shipped.link)
    alone = tmp_path / "alone.toml"
    alone.write_text('base = "none.toml"\n', encoding="utf-8")
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read: No such file or directory"):
        read_arm(alone)


ELBOW, LENGTH = 0.1, 0.05


@pytest.fixture(params=["panda", "fr3", "fr3v2"])
def arm(request):
    return read_arm(arm_file(request.param))


def test_the_links_are_where_the_laws_own_kinematics_have_them(arm):
    q = np.array(arm.home) + 0.1
    rotations, origins = links(arm, q)
    _, _, axes, places = impedance.forward(impedance.figures(arm), q)
    np.testing.assert_allclose([R[:, 2] for R in rotations], axes, atol=1e-12)
    np.testing.assert_allclose(origins, places, atol=1e-12)


@pytest.mark.parametrize("tilt", [0.0, 0.7854])
def test_the_joints_found_hold_the_peg_within_their_limits(arm, tilt):
    tip, (axis, closing) = np.array([0.5, 0.03, 0.1]), Round(0.008).leaning(0.4, tilt)
    q = joints_at(arm, tip, axis, closing, LENGTH, ELBOW)
    position, finger, _, _ = impedance.forward(impedance.figures(arm), q)
    np.testing.assert_allclose(position + LENGTH * finger[:, 0], tip, atol=1e-8)
    np.testing.assert_allclose(finger[:, 0], -axis, atol=1e-8)
    np.testing.assert_allclose(finger[:, 2], closing, atol=1e-8)
    assert q[arm.kinematics.elbow - 1] == ELBOW
    assert (q >= arm.joints.q_min).all()
    assert (q <= arm.joints.q_max).all()


@pytest.mark.parametrize("tip", [[1.2, 0.0, 0.1], [0.5, 0.0, -0.6]])
def test_what_the_arm_does_not_reach_has_no_joints(arm, tip):
    axis, closing = Round(0.008).leaning(0.0, 0.0)
    assert joints_at(arm, np.array(tip), axis, closing, LENGTH, ELBOW) is None


@pytest.fixture(params=[0.0, 0.4])
def q(request, arm):
    return np.array(arm.home) + request.param * np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0])


def test_the_arms_inertia_is_that_of_the_physics(arm, q, loaded):
    shapes.install(loaded.cell.peg.part)
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


def test_a_push_accelerates_the_tip_by_its_inertia(arm, q):
    length, push = 0.05, np.array([3.0, -2.0, 1.0, 0.1, 0.2, -0.1])
    position, finger, axes, origins = impedance.forward(impedance.figures(arm), q)
    tip = position + length * finger[:, 0]
    J = np.vstack([np.cross(axes, tip - origins).T, axes.T])
    M = joint_inertia(arm, q) + np.diag(arm.joints.rotor_inertia)
    acceleration = J @ np.linalg.solve(M, J.T @ push)
    np.testing.assert_allclose(tip_inertia(arm, q, length) @ acceleration, push, atol=1e-9)


STIFFNESS = np.array([1500.0, 1500.0, 600.0, 40.0, 40.0, 40.0])


def compiled(arm, q):
    figures = impedance.figures(arm)
    rotations, origins = impedance.links(figures, q)
    return dynamics.joint_inertia(figures[impedance.MASSES :], rotations, origins)


def test_compiled_and_plain_inertia_agree_in_joints_and_at_the_tip(arm, q):
    length, made = 0.05, compiled(arm, q)
    np.testing.assert_allclose(made, joint_inertia(arm, q) + np.diag(arm.joints.rotor_inertia), rtol=1e-12, atol=1e-12)
    position, finger, axes, origins = impedance.forward(impedance.figures(arm), q)
    J = jacobian(position + length * finger[:, 0], axes, origins)
    np.testing.assert_allclose(dynamics.inertia_at(made, J), tip_inertia(arm, q, length), rtol=1e-9)


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


def test_a_direction_without_stiffness_is_hardly_damped(arm, q):
    L = tip_inertia(arm, q, 0.05)
    loose = dynamics.critical_damping(np.diag(np.diag(L)), np.array([*STIFFNESS[:5], 0.0]))
    whole = dynamics.critical_damping(np.diag(np.diag(L)), STIFFNESS)
    assert 0.0 < loose[5, 5] < 0.1 * whole[5, 5]
    np.testing.assert_allclose(np.diag(loose)[:5], np.diag(whole)[:5], rtol=1e-4)


def test_an_arm_that_is_stretched_out_is_damped_without_an_error(arm):
    state, rates = impedance.new_state(arm), np.full(7, 0.1)
    tau = impedance.torque(impedance.figures(arm), holding_words(), state, np.zeros(7), rates, 0.0, 1e-3)
    assert np.isfinite(tau).all()


def pose(position, rotation):
    """Return a transform as libfranka writes it: 16 numbers, column-major."""
    matrix = np.eye(4)
    matrix[:3, 3], matrix[:3, :3] = position, rotation
    return matrix.T.flatten()


def test_the_reported_wrench_is_reversed_and_taken_about_the_tool_centre_point():
    """Source: robot_state.h, forces of the robot on the environment are positive."""
    at, turned = np.array([0.5, 0.1, 0.3]), np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    k_in_ee = np.array([0.02, 0.0, 0.05])
    reported = np.array([4.0, -3.0, -10.0, 0.5, 0.2, -0.1])
    force, torque = wrench_on_hand(reported, pose(at, turned), pose(k_in_ee, np.eye(3)), at + 0.1 * UP)
    lever = turned @ k_in_ee - 0.1 * UP
    assert force == pytest.approx(-reported[:3])
    assert torque == pytest.approx(-reported[3:] + np.cross(lever, -reported[:3]))
