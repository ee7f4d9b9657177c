import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config.files import arm_file
from drivers import impedance
from drivers.arm.model import read_arm
from sim.arm import joint_drive
from sim.arm.arm_truth import JointFriction, Payload, TorquePath, every, ideal

PANDA = read_arm(arm_file("panda"))
FIGURES = impedance.figures(PANDA)
TRUTH = ideal(PANDA)
CURVE = JointFriction.published_curve(PANDA.joints)
PERIOD, TICK = 1e-3, 5e-4
Q, STILL = np.array(PANDA.home), np.zeros(7)


class Joints:
    """The drives of an arm whose joints do not move, or all at one velocity."""

    def __init__(self, tick=TICK, dq=0.0, **departure):
        self.words = joint_drive.words_of(replace(TRUTH, **departure), PERIOD, (tick, 2 * tick))
        self.tick, self.dq, self.qfrc = tick, np.full(7, dq), np.zeros(7)

    def cycle(self, torque, q=Q):
        """Command the same torque of every joint for one control period; return what acts at its end."""
        joint_drive.command(self.words, FIGURES, q, np.full(7, torque), self.qfrc)
        for _ in range(round(PERIOD / self.tick)):
            joint_drive.act(self.words, self.dq, self.qfrc, False)
        return self.qfrc.copy()


def test_an_ideal_drive_lets_a_command_act_as_it_is():
    tau = np.array([1.0, -2.0, 3.0, 0.1, -0.2, 0.3, 1e-17])
    joints = Joints()
    joint_drive.command(joints.words, FIGURES, Q, tau, joints.qfrc)
    joint_drive.act(joints.words, np.ones(7), joints.qfrc, False)
    np.testing.assert_array_equal(joints.qfrc, tau)


@pytest.mark.parametrize("cycles", [0, 1, 2, 7])
def test_a_delay_of_n_cycles_shows_as_n_cycles(cycles):
    joints = Joints(path=TorquePath(delay=cycles, rate=1e9))
    acting = [joints.cycle(float(k + 1))[0] for k in range(12)]
    assert acting == pytest.approx([max(k + 1 - cycles, 0.0) for k in range(12)])


@pytest.mark.parametrize("tick", [5e-4, 1.25e-4])
def test_a_low_pass_has_gone_two_thirds_of_the_way_after_its_time_constant(tick):
    joints = Joints(tick, path=TorquePath(cutoff=100.0))
    acting = [joints.cycle(1.0)[0] for _ in range(10)]
    assert acting == pytest.approx([1.0 - math.exp(-2.0 * math.pi * 100.0 * PERIOD * (k + 1)) for k in range(10)])


def test_a_long_step_goes_as_far_as_its_ticks():
    joints = Joints(path=TorquePath(cutoff=100.0))
    long = joints.words.copy()
    acting = joints.cycle(1.0)
    at_once = np.zeros(7)
    joint_drive.command(long, FIGURES, Q, np.ones(7), at_once)
    joint_drive.act(long, STILL, at_once, True)
    np.testing.assert_allclose(at_once, acting)


def test_a_rate_limit_lets_a_torque_change_so_much_a_cycle():
    joints = Joints(path=TorquePath(rate=500.0))
    acting = [joints.cycle(2.0)[0] for _ in range(6)]
    assert acting == pytest.approx([0.5, 1.0, 1.5, 2.0, 2.0, 2.0])


def test_the_published_curve_is_nothing_at_rest_and_the_quoted_level_far_from_it():
    words = Joints(friction=CURVE).words
    assert joint_drive.friction(words, 0, 0.0) == 0.0
    # The same authors' Coulomb figure of joint 1 is 0.245 N·m.
    assert joint_drive.friction(words, 0, 100.0) == pytest.approx(0.245, abs=2e-3)
    assert joint_drive.friction(words, 0, -100.0) == pytest.approx(-0.301, abs=2e-3)


@pytest.mark.parametrize("joint", range(7))
def test_friction_never_creates_energy(joint):
    words = Joints(friction=replace(CURVE, viscous=every(0.1))).words
    powers = [dq * joint_drive.friction(words, joint, dq) for dq in np.linspace(-3.0, 3.0, 601) if dq]
    assert min(powers) > 0.0


def test_each_joint_is_scaled_on_its_own():
    factors = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 0.1)
    plain, scaled = (Joints(dq=0.4, friction=law).words for law in (CURVE, CURVE.scaled(factors)))
    once, told = (np.array([joint_drive.friction(words, j, 0.4) for j in range(7)]) for words in (plain, scaled))
    np.testing.assert_allclose(told, once * factors)


def test_smooth_friction_takes_a_torque_from_a_joint_that_moves_and_none_from_one_at_rest():
    still, moving = (Joints(dq=dq, friction=CURVE).cycle(2.0) for dq in (0.0, 1.0))
    np.testing.assert_allclose(still, 2.0)
    assert (moving < 1.9).all()


def test_a_payload_turns_the_joints_down_the_slope_of_its_height():
    at, mass, h = (0.03, -0.02, 0.12), 0.7, 1e-6
    joints = Joints(payload=Payload(mass, at))
    felt = joints.cycle(0.0)

    def height(q):
        # The hand's axes x, y and z are y, z and x of the finger frame.
        position, finger, _, _ = impedance.forward(FIGURES, q)
        way = np.array([at[2] - PANDA.hand.finger_centre, at[0], at[1]])
        return (position + finger @ way)[2]

    slope = [(height(Q + h * e) - height(Q - h * e)) / (2 * h) for e in np.eye(7)]
    np.testing.assert_allclose(felt, -mass * joint_drive.GRAVITY * np.array(slope), atol=1e-6)


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
    assert joint_drive.stiffest(replace(truth, rotor_inertia=every(0.1)), Q, TICK) < 0.05
