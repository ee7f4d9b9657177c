"""What the meters keep: a penetration that lasts, the largest force on a held peg, and the time above a bound."""

import numpy as np
import pytest

from sim import contact, metering

TICKS = 3
take, judge = metering.take.py_func, metering.judge.py_func


def judged(depths):
    meters, userdata = metering.new_meters(), np.zeros(128)
    for depth in depths:
        userdata[contact.PENETRATION] = depth
        judge(meters, userdata, TICKS)
    return meters[metering.SUSTAINED]


def test_a_penetration_counts_once_it_has_lasted():
    assert judged([1e-5] * (TICKS - 1)) == 0.0
    assert judged([1e-5] * TICKS) == 1e-5


def test_of_a_penetration_that_grows_the_depth_counts_that_has_lasted():
    assert judged([1e-6, 2e-6, 3e-6, 4e-6]) == 2e-6


@pytest.mark.parametrize(("hinge", "peak"), [(0, 30.0), (-1, 0.0)])
def test_the_force_is_that_on_a_held_peg(hinge, peak):
    meters = metering.new_meters()
    for _ in range(2000):
        take(meters, np.array([0.0, 0.0, 30.0]), np.zeros(3), 0.001, hinge, np.zeros(1))
    assert meters[metering.PEAK_FORCE] == pytest.approx(peak)
    assert bool(meters[metering.OVER_TIME] > 1.9) == (hinge >= 0)
