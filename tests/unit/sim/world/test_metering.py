"""Values that the meters keep: a penetration that lasts, the largest force on a held peg, the time above a bound, and the jerk of the hand."""

import math

import numpy as np
import pytest

from sim.contact import table as contact
from sim.world import metering
from skills.motion import minimum_jerk

TICKS = 3
take, judge = metering.take.py_func, metering.judge.py_func


def judged(depths):
    meters, userdata = metering.new_meters(), np.zeros(128)
    for depth in depths:
        userdata[contact.PENETRATION] = depth
        judge(meters, userdata, TICKS)
    return meters[metering.SUSTAINED]


@pytest.mark.parametrize(
    ("depths", "counted"),
    [([1e-5] * (TICKS - 1), 0.0), ([1e-5] * TICKS, 1e-5), ([1e-6, 2e-6, 3e-6, 4e-6], 2e-6)],
)
def test_of_a_penetration_the_depth_counts_that_has_lasted(depths, counted):
    assert judged(depths) == counted


@pytest.mark.parametrize(("hinge", "peak"), [(0, 30.0), (-1, 0.0)])
def test_the_force_is_that_on_a_held_peg(hinge, peak):
    meters = metering.new_meters()
    for _ in range(2000):
        take(meters, np.array([0.0, 0.0, 30.0]), np.zeros(3), 0.001, hinge, np.zeros(1))
    assert meters[metering.PEAK_FORCE] == pytest.approx(peak)
    assert bool(meters[metering.OVER_TIME] > 1.9) == (hinge >= 0)


RATE = 2.0 * math.pi * metering.JERK_BANDWIDTH


def jerk_of(velocity, steps, is_free=True, spin=(0.0, 0.0, 0.0), lever=(0.0, 0.0, 0.0)):
    """Return the largest jerk of a hand whose reference moves at `velocity(time)` along x, over steps of these lengths."""
    meters, time = metering.new_meters(), 0.0
    reference = np.array([0.4, 0.1, 0.2])
    left, right = reference + lever + (0.0, 0.02, 0.0), reference + lever - (0.0, 0.02, 0.0)
    for step in steps:
        hand = metering.HandView(np.array([*spin, velocity(time), 0.0, 0.0]), reference, left, right)
        metering.take_jerk.py_func(meters, hand, step, is_free)
        time += step
    return meters[metering.JERK_FREE], meters[metering.JERK_CONTACT]


@pytest.mark.parametrize("steps", [[5e-4] * 4000, [5e-4, 1e-3] * 1350], ids=["even", "of two lengths"])
@pytest.mark.parametrize("frequency", [2.0, 5.0, 10.0])
def test_the_jerk_of_a_swing_is_amplitude_times_rate_cubed(steps, frequency):
    rate, amplitude = 2.0 * math.pi * frequency, 0.01
    free, contact = jerk_of(lambda time: amplitude * rate * (1.0 - math.cos(rate * time)), steps)
    gain = 1.0 / math.hypot(1.0, (rate / RATE) ** 2)
    # The first swing starts from rest, which adds what dies away.
    assert free == pytest.approx(amplitude * rate**3 * gain, rel=0.02)
    assert contact == 0.0


def test_the_jerk_of_a_minimum_jerk_move_is_the_known_one():
    way, duration = 0.3, 2.0
    free, _ = jerk_of(lambda time: way / duration * minimum_jerk(time / duration)[1], [5e-4] * 4000)
    # The low-pass takes 0.03 s to get there, in which the jerk has fallen by 7 %.
    assert 0.9 * 60.0 * way / duration**3 < free < 60.0 * way / duration**3


@pytest.mark.parametrize(
    ("speed", "turns"), [(0.05, {}), (0.0, {"spin": (0.0, 0.0, 1.0), "lever": (0.05, 0.0, 0.0)})], ids=["slide", "turn"]
)
def test_the_jerk_of_a_stop_is_speed_times_corner_rate_squared(speed, turns):
    free, contact = jerk_of(lambda time: speed, [5e-4] * 1000, is_free=False, **turns)
    assert (free, contact) == (0.0, pytest.approx(0.05 * RATE**2, rel=0.03))
