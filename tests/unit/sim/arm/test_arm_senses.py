import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config.files import arm_file
from drivers import impedance
from drivers.arm.model import read_arm
from sim.arm import arm_senses
from sim.arm.arm_truth import StateReading, WrenchReading, every, ideal

PANDA = read_arm(arm_file("panda"))
FIGURES = impedance.figures(PANDA)
TRUTH = ideal(PANDA)
PERIOD = 1e-3
Q, DQ, NOTHING = np.array(PANDA.home), np.linspace(-0.3, 0.3, 7), np.zeros(6)
NO_TORQUE = np.zeros(7)


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
    np.testing.assert_allclose(arm_senses.scanned(words, FIGURES, NO_TORQUE)[0] - Q, zero, atol=1e-15)


def test_noise_is_as_strong_as_it_is_said_to_be():
    rates = (1e-3, 0.0, 2e-3, 1e-3, 1e-3, 1e-3, 5e-3)
    words, rng = senses(reading=StateReading(noise=2e-5, rate_noise=rates)), np.random.default_rng(3)
    # The returned array is a view of the ring.
    told = np.array([np.concatenate(read(words, noise=rng.standard_normal(arm_senses.NOISES))) for _ in range(4000)])
    np.testing.assert_allclose(told[:, :7].std(axis=0), 2e-5, rtol=0.05)
    np.testing.assert_allclose(told[:, 7:].std(axis=0), rates, rtol=0.05, atol=1e-9)


def test_an_encoder_with_play_follows_its_link_by_half_the_play_behind_it():
    words, play = senses(reading=StateReading(backlash=0.002)), np.array([0.0] * 4 + [0.001] * 3)
    there, _ = read(words, q=Q + 0.01)
    np.testing.assert_allclose(there, Q + 0.01 - play, atol=1e-12)
    still, _ = read(words, q=Q + 0.009)
    np.testing.assert_allclose(still[4:], Q[4:] + 0.009, atol=1e-12)
    back, _ = read(words, q=Q)
    np.testing.assert_allclose(back, Q + play, atol=1e-12)


@pytest.mark.parametrize("cycles", [1, 3, 12])
def test_a_scan_reads_a_state_so_many_cycles_old_and_the_law_the_newest(cycles):
    words = senses(reading=StateReading(delay=cycles))
    for k in range(20):
        newest, _ = read(words, q=np.full(7, float(k)))
    assert newest[0] == 19.0
    assert arm_senses.scanned(words, FIGURES, NO_TORQUE)[0][0] == 19.0 - cycles


def test_ideal_senses_and_a_scan_before_the_first_cycle_read_what_is():
    q, dq, wrench, _, _ = arm_senses.scanned(senses(reading=StateReading(delay=5)), FIGURES, NO_TORQUE)
    for there, rates in ((q, dq), read(senses(), noise=np.ones(arm_senses.NOISES))):
        np.testing.assert_array_equal(there, Q)
        np.testing.assert_array_equal(rates, DQ)
    np.testing.assert_array_equal(wrench, 0.0)


def test_joint_torques_that_a_wrench_would_explain_are_told_as_that_wrench():
    push = np.array([3.0, -2.0, 5.0, 0.2, -0.1, 0.3])
    position, _, axes, origins = impedance.forward(FIGURES, Q)
    J = np.vstack([np.cross(axes, position - origins).T, axes.T])
    words = senses(wrench=WrenchReading(joint_torque=tuple(J.T @ push)))
    read(words)
    np.testing.assert_allclose(arm_senses.scanned(words, FIGURES, NO_TORQUE)[2], push, atol=1e-5)
    # Torques that are not in the arm's model are measured exactly.
    words = senses(reading=StateReading(delay=1))
    np.testing.assert_allclose(arm_senses.scanned(words, FIGURES, J.T @ push)[2], push, atol=1e-5)


def test_an_error_of_the_modelled_torques_moves_with_the_posture():
    words = senses(wrench=WrenchReading(joint_torque=(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0)))
    told = []
    for q in (Q, Q + np.array([0.6, 0.3, 0.0, 0.4, 0.0, 0.0, 0.0])):
        read(words, q=q)
        told.append(arm_senses.scanned(words, FIGURES, NO_TORQUE)[2][:3])
    assert 0.5 < np.linalg.norm(told[0]) < 10.0
    assert np.linalg.norm(told[1] - told[0]) > 0.2


def test_a_dead_zone_takes_its_width_from_what_is_told_and_tells_nothing_within():
    words = senses(wrench=WrenchReading(force_dead_zone=2.0, torque_dead_zone=0.1))
    read(words, wrench=np.array([5.0, -1.0, -3.0, 0.05, -0.3, 0.0]))
    told = arm_senses.scanned(words, FIGURES, NO_TORQUE)[2]
    np.testing.assert_allclose(told, [3.0, 0.0, -1.0, 0.0, -0.2, 0.0], atol=1e-12)


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


def test_a_force_told_where_nothing_touches_is_told_as_it_is():
    words = senses(wrench=WrenchReading(force=(1.0, -2.0, 4.0)), reading=StateReading(rate_noise=every(0.0)))
    np.testing.assert_allclose(arm_senses.scanned(words, FIGURES, NO_TORQUE)[2], [1.0, -2.0, 4.0, 0.0, 0.0, 0.0])
