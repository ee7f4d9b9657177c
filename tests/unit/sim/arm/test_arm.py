"""Departures of an arm from its model: drawn, driven, felt and read."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config.files import ERRORS_FILE, arm_file
from cell.config.files import SHIPPED as SHIPPED_FILES
from drivers import impedance
from drivers.arm.model import read_arm
from drivers.errors import ConfigError
from sim.arm import arm_senses, joint_drive
from sim.arm.arm_truth import JointFriction, StateReading, TorquePath, WrenchReading, ideal
from sim.arm.drawn_arm import drawn_arm
from sim.config import RealityConfig
from sim.world.reality import AS_BELIEVED
from sim.world.reality import read as read_errors

PANDA = read_arm(arm_file("panda"))
TRUTH = ideal(PANDA)


def test_the_ideal_arm_is_what_the_cell_believes():
    assert TRUTH.model is PANDA
    assert drawn_arm(PANDA, AS_BELIEVED) == TRUTH
    assert TRUTH.friction == JointFriction(dry=PANDA.joints.friction)
    assert joint_drive.words_of(TRUTH, (5e-4, 1e-3))[joint_drive.IS_IDEAL] == 1.0
    assert arm_senses.words_of(TRUTH, 1e-3)[arm_senses.IS_IDEAL] == 1.0


@pytest.mark.parametrize(
    ("departure", "is_felt_by", "is_read_by"),
    [
        ({"path": TorquePath(delay=1)}, True, False),
        ({"path": TorquePath(cutoff=100.0)}, True, False),
        ({"friction": JointFriction(viscous=(0.1,) * 7)}, True, False),
        ({"gravity": (0.1,) * 7}, True, True),
        ({"reading": StateReading(zero=(1e-3,) * 7)}, False, True),
        ({"reading": StateReading(rate_noise=(1e-3,) * 7)}, False, True),
        ({"wrench": WrenchReading(force=(0.0, 0.0, 1.0))}, False, True),
        ({"wrench": WrenchReading(cutoff=30.0)}, False, True),
        ({"rotor_inertia": (0.1,) * 7}, False, False),
        ({"friction": JointFriction(dry=(0.1,) * 7)}, False, False),
    ],
)
def test_every_departure_is_known_to_what_it_concerns(departure, is_felt_by, is_read_by):
    truth = replace(TRUTH, **departure)
    drive = joint_drive.words_of(truth, (5e-4, 1e-3))
    assert drive[joint_drive.IS_IDEAL] == (not is_felt_by)
    assert arm_senses.words_of(truth, 1e-3)[arm_senses.IS_IDEAL] == (not is_read_by)


@pytest.mark.parametrize(
    "wrong",
    [
        {"path": TorquePath(delay=-1)},
        {"path": TorquePath(delay=51)},
        {"path": TorquePath(cutoff=0.0)},
        {"reading": StateReading(noise=-1e-5)},
        {"rotor_inertia": (0.1, 0.1, -0.1, 0.1, 0.1, 0.1, 0.1)},
        {"friction": JointFriction(dry=(-0.1,) * 7)},
    ],
)
def test_what_no_arm_can_be_is_refused_in_one_line(wrong):
    with pytest.raises(ConfigError, match=r"^arm truth: [^\n]+ allowed$"):
        replace(TRUTH, **wrong)


def test_lag_and_transport_become_a_low_pass_and_control_cycles():
    drawn = {"arm.torque_lag": np.array(1.0 / (2.0 * math.pi * 100.0)), "arm.transport": np.array(0.002)}
    path = drawn_arm(PANDA, {**AS_BELIEVED, **drawn}).path
    assert (path.cutoff, path.delay) == (pytest.approx(100.0), 2)


def test_the_published_curve_replaces_dry_friction_joint_by_joint():
    level = np.linspace(0.5, 2.0, 7)
    drawn = {**AS_BELIEVED, "arm.sigmoid_friction": np.array(1.0), "arm.friction_level": level}
    friction = drawn_arm(PANDA, drawn).friction
    curve = PANDA.joints.smooth_friction
    assert friction.dry == (0.0,) * 7
    assert friction.span == pytest.approx(level * np.array(curve.span))


def test_an_arm_with_errors_at_scale_1_differs_in_everything():
    truth, believed = drawn_arm(PANDA, read_errors(SHIPPED_FILES / ERRORS_FILE).draw(8, RealityConfig())), ideal(PANDA)
    for name in ("friction", "rotor_inertia", "path", "reading", "wrench", "gravity", "tcp_offset"):
        assert getattr(truth, name) != getattr(believed, name)


FIGURES = impedance.figures(PANDA)
CURVE = JointFriction.published_curve(PANDA.joints)
PERIOD, TICK = 1e-3, 5e-4
Q, STILL = np.array(PANDA.home), np.zeros(7)


class Joints:
    """The drives of an arm whose joints do not move, or all at one velocity."""

    def __init__(self, tick=TICK, dq=0.0, **departure):
        self.words = joint_drive.words_of(replace(TRUTH, **departure), (tick, 2 * tick))
        self.tick, self.dq, self.qfrc = tick, np.full(7, dq), np.zeros(7)

    def cycle(self, torque):
        """Command the same torque of every joint for one control period; return what acts at its end."""
        joint_drive.command(self.words, np.full(7, torque), self.qfrc)
        for _ in range(round(PERIOD / self.tick)):
            joint_drive.act(self.words, self.dq, self.qfrc, False)
        return self.qfrc.copy()


def test_an_ideal_drive_lets_a_command_act_as_it_is():
    tau = np.array([1.0, -2.0, 3.0, 0.1, -0.2, 0.3, 1e-17])
    joints = Joints()
    joint_drive.command(joints.words, tau, joints.qfrc)
    joint_drive.act(joints.words, np.ones(7), joints.qfrc, False)
    np.testing.assert_array_equal(joints.qfrc, tau)


@pytest.mark.parametrize("cycles", [1, 2, 7])
def test_a_delay_of_n_cycles_shows_as_n_cycles(cycles):
    joints = Joints(path=TorquePath(delay=cycles))
    acting = [joints.cycle(float(k + 1))[0] for k in range(12)]
    assert acting == pytest.approx([max(k + 1 - cycles, 0.0) for k in range(12)])


@pytest.mark.parametrize("tick", [5e-4, 1.25e-4])
def test_a_low_pass_follows_by_its_time_constant(tick):
    joints = Joints(tick, path=TorquePath(cutoff=100.0))
    acting = [joints.cycle(1.0)[0] for _ in range(10)]
    assert acting == pytest.approx([1.0 - math.exp(-2.0 * math.pi * 100.0 * PERIOD * (k + 1)) for k in range(10)])


def test_a_long_step_goes_as_far_as_its_ticks():
    joints = Joints(path=TorquePath(cutoff=100.0))
    long = joints.words.copy()
    acting = joints.cycle(1.0)
    at_once = np.zeros(7)
    joint_drive.command(long, np.ones(7), at_once)
    joint_drive.act(long, STILL, at_once, True)
    np.testing.assert_allclose(at_once, acting)


def test_the_published_curve_is_zero_at_rest_and_reaches_its_level():
    words = Joints(friction=CURVE).words
    assert joint_drive.friction(words, 0, 0.0) == 0.0
    # The same authors' Coulomb figure of joint 1 is 0.245 N·m.
    assert joint_drive.friction(words, 0, 100.0) == pytest.approx(0.245, abs=2e-3)
    assert joint_drive.friction(words, 0, -100.0) == pytest.approx(-0.301, abs=2e-3)


@pytest.mark.parametrize("joint", range(7))
def test_friction_never_creates_energy(joint):
    words = Joints(friction=replace(CURVE, viscous=(0.1,) * 7)).words
    powers = [dq * joint_drive.friction(words, joint, dq) for dq in np.linspace(-3.0, 3.0, 601) if dq]
    assert min(powers) > 0.0


def test_each_joint_is_scaled_on_its_own():
    factors = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 0.1)
    plain, scaled = (Joints(dq=0.4, friction=law).words for law in (CURVE, CURVE.scaled(factors)))
    once, told = (np.array([joint_drive.friction(words, j, 0.4) for j in range(7)]) for words in (plain, scaled))
    np.testing.assert_allclose(told, once * factors)


def test_smooth_friction_acts_only_on_a_moving_joint():
    still, moving = (Joints(dq=dq, friction=CURVE).cycle(2.0) for dq in (0.0, 1.0))
    np.testing.assert_allclose(still, 2.0)
    assert (moving < 1.9).all()


def test_what_gravity_leaves_over_acts_beside_the_command():
    left = (0.1, -0.5, 0.2, 0.5, 0.0, 0.1, 0.0)
    np.testing.assert_allclose(Joints(gravity=left).cycle(1.0), 1.0 + np.array(left))


def test_a_new_arm_takes_the_torque_over_that_was_commanded():
    joints = Joints(path=TorquePath(delay=2, cutoff=50.0))
    joint_drive.fill(joints.words, np.full(7, 3.0))
    np.testing.assert_allclose(joints.cycle(3.0), 3.0)


def test_the_steepest_published_friction_is_stable_at_the_shipped_step():
    truth = replace(TRUTH, friction=CURVE)
    assert 0.05 < joint_drive.stiffest(truth, Q, TICK) < 0.3
    assert joint_drive.stiffest(replace(truth, rotor_inertia=(0.1,) * 7), Q, TICK) < 0.05


DQ, NOTHING = np.linspace(-0.3, 0.3, 7), np.zeros(6)
NO_TORQUE, LAW = np.zeros(7), impedance.new_state(PANDA)


def senses(**departure):
    words = arm_senses.words_of(replace(TRUTH, **departure), PERIOD)
    arm_senses.fill(words, Q, DQ)
    return words


def read(words, q=Q, dq=DQ, wrench=NOTHING, noise=None):
    return arm_senses.measure(words, q, dq, wrench, np.zeros(arm_senses.NOISES) if noise is None else noise)


def test_a_wrong_zero_shifts_what_law_and_scan_read_alike():
    zero = (0.001, -0.002, 0.0, 0.003, 0.0, 0.0, -0.001)
    words = senses(reading=StateReading(zero=zero))
    q, _ = read(words)
    np.testing.assert_allclose(q - Q, zero, atol=1e-15)
    np.testing.assert_allclose(arm_senses.scanned(words, FIGURES, NO_TORQUE, LAW)[0] - Q, zero, atol=1e-15)


def test_noise_is_as_strong_as_it_is_said_to_be():
    rates = (1e-3, 0.0, 2e-3, 1e-3, 1e-3, 1e-3, 5e-3)
    words, rng = senses(reading=StateReading(noise=2e-5, rate_noise=rates)), np.random.default_rng(3)
    # The returned arrays are views of the words.
    told = np.array([np.concatenate(read(words, noise=rng.standard_normal(arm_senses.NOISES))) for _ in range(4000)])
    np.testing.assert_allclose(told[:, :7].std(axis=0), 2e-5, rtol=0.05)
    np.testing.assert_allclose(told[:, 7:].std(axis=0), rates, rtol=0.05, atol=1e-9)


def test_an_encoder_follows_half_its_play_behind_the_link():
    words, play = senses(reading=StateReading(backlash=0.002)), np.array([0.0] * 4 + [0.001] * 3)
    there, _ = read(words, q=Q + 0.01)
    np.testing.assert_allclose(there, Q + 0.01 - play, atol=1e-12)
    still, _ = read(words, q=Q + 0.009)
    np.testing.assert_allclose(still[4:], Q[4:] + 0.009, atol=1e-12)
    back, _ = read(words, q=Q)
    np.testing.assert_allclose(back, Q + play, atol=1e-12)


def test_ideal_senses_and_a_scan_before_the_first_cycle_read_what_is():
    q, dq, wrench, *_ = arm_senses.scanned(senses(reading=StateReading(noise=1e-5)), FIGURES, NO_TORQUE, LAW)
    for there, rates in ((q, dq), read(senses(), noise=np.ones(arm_senses.NOISES))):
        np.testing.assert_array_equal(there, Q)
        np.testing.assert_array_equal(rates, DQ)
    np.testing.assert_array_equal(wrench, 0.0)


def test_joint_torques_of_a_wrench_are_reported_as_that_wrench():
    push = np.array([3.0, -2.0, 5.0, 0.2, -0.1, 0.3])
    position, _, axes, origins = impedance.forward(FIGURES, Q)
    J = np.vstack([np.cross(axes, position - origins).T, axes.T])
    words = senses(wrench=WrenchReading(joint_torque=tuple(J.T @ push)))
    read(words)
    np.testing.assert_allclose(arm_senses.scanned(words, FIGURES, NO_TORQUE, LAW)[2], push, atol=1e-5)
    # Torques that are not in the arm's model are measured exactly.
    words = senses(reading=StateReading(noise=1e-5))
    np.testing.assert_allclose(arm_senses.scanned(words, FIGURES, J.T @ push, LAW)[2], push, atol=1e-5)


def test_an_error_of_the_modelled_torques_moves_with_the_posture():
    words = senses(wrench=WrenchReading(joint_torque=(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0)))
    told = []
    for q in (Q, Q + np.array([0.6, 0.3, 0.0, 0.4, 0.0, 0.0, 0.0])):
        read(words, q=q)
        told.append(arm_senses.scanned(words, FIGURES, NO_TORQUE, LAW)[2][:3])
    assert 0.5 < np.linalg.norm(told[0]) < 10.0
    assert np.linalg.norm(told[1] - told[0]) > 0.2


def test_a_low_pass_of_the_wrench_answers_late_and_quiets_its_noise():
    cutoff = 20.0
    words = senses(wrench=WrenchReading(cutoff=cutoff, force_noise=1.0))
    for _ in range(8):
        read(words, wrench=np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert words[arm_senses.WRENCH] == pytest.approx(1.0 - math.exp(-2.0 * math.pi * cutoff * 8 * PERIOD))
    words, rng, told = senses(wrench=WrenchReading(cutoff=cutoff, force_noise=1.0)), np.random.default_rng(4), []
    for _ in range(20000):
        read(words, noise=rng.standard_normal(arm_senses.NOISES))
        told.append(words[arm_senses.WRENCH : arm_senses.WRENCH + 3].copy())
    blend = 1.0 - math.exp(-2.0 * math.pi * cutoff * PERIOD)
    assert np.std(told) == pytest.approx(math.sqrt(blend / (2.0 - blend)), rel=0.1)


def test_an_offset_of_the_force_is_reported_as_it_is():
    words = senses(wrench=WrenchReading(force=(1.0, -2.0, 4.0)), reading=StateReading(rate_noise=(0.0,) * 7))
    np.testing.assert_allclose(arm_senses.scanned(words, FIGURES, NO_TORQUE, LAW)[2], [1.0, -2.0, 4.0, 0.0, 0.0, 0.0])
