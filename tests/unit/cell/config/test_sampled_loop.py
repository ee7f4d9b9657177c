"""The stability limit of a sampled loop is that of its exact discretisation."""

import math

import numpy as np
import pytest

from cell.config.sampled_loop import MOST, largest_factor, one_period

ONE = np.ones((1, 1))
TABLE = [(1.0, 25.0, 3.57, 1.23), (0.7, 17.8, 1.45, 0.50), (0.5, 15.4, 0.61, 0.22)]
"""Damping ratio; largest K T²/m at no extra delay, one sample, two samples."""


def limit(ratio: float, delay: float, period: float = 1.0, mass: float = 1.0) -> float:
    """Return the largest K T²/m."""
    least = 1e-3 * mass / period**2

    def loop(factor):
        gain = factor * least
        return mass * ONE, gain * ONE, 0.0 * ONE, 2.0 * ratio * math.sqrt(gain * mass) * ONE

    return 1e-3 * largest_factor(loop, period, delay)


@pytest.mark.parametrize(("ratio", "none", "one", "two"), TABLE)
def test_the_limits_are_those_of_the_exact_discretisation(ratio, none, one, two):
    found = [limit(ratio, delay) for delay in (0.0, 1.0, 2.0)]
    assert found == pytest.approx([none, one, two], rel=0.03)


def test_only_the_gain_times_period_squared_over_mass_counts():
    assert limit(0.7, 1.0, period=0.1, mass=3.0) == pytest.approx(limit(0.7, 1.0), rel=1e-3)


def test_one_period_equals_a_fine_integration():
    gain, damping, delay, steps = 2.0, 1.0, 1.25, 20000
    x, v, earlier = 0.3, -0.1, [0.7, -0.2]
    step = one_period(ONE, gain * ONE, 0.5 * ONE, damping * ONE, 1.0, delay)
    predicted = step @ np.array([x, v, *earlier])
    held = earlier[1]
    for k in range(steps):
        held = earlier[1] if k < 0.25 * steps else earlier[0]
        v += (-gain * held - 0.5 * x - damping * v) / steps
        x += v / steps
    assert predicted == pytest.approx([x, v, 0.3, 0.7], abs=1e-4)


def test_a_loop_without_delay_has_no_limit():
    assert largest_factor(lambda factor: (ONE, 0.0 * ONE, factor * ONE, ONE), 0.1, 2.0) == MOST
