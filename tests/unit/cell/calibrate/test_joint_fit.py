"""Figures of a joint from passes to and fro, with intervals that hold what is true."""

import math

import numpy as np
import pytest

from cell.calibrate.joint_fit import Pass, fit
from cell.records.statistics import student

SPEEDS = (0.06, 0.15, 0.35)


def passes(law, offset, noise=0.0, seed=0):
    """Return two passes at each speed in either sense of a joint with this law of friction."""
    rng = np.random.default_rng(seed)
    return [
        Pass(sense * speed, sense * speed, sense * law(speed) + offset + rng.normal(0.0, noise))
        for speed in SPEEDS
        for sense in (-1.0, 1.0, -1.0, 1.0)
    ]


@pytest.mark.parametrize("law", [lambda v: 0.8, lambda v: 0.5 + 0.2 * v, lambda v: 0.6 * math.tanh(5.1 * v / 2)])
def test_friction_of_any_law_is_within_its_interval(law):
    found = fit(passes(law, -0.4), SPEEDS)
    for speed, (value, interval) in zip(SPEEDS, found.friction, strict=True):
        assert abs(value - law(speed)) < interval
    assert found.offset[0] == pytest.approx(-0.4)


def test_intervals_hold_the_truth_as_often_as_they_say():
    """Torques that scatter by more than the observer resolves: 95 of 100 are asked for, and few runs say less."""
    held = 0
    for seed in range(200):
        value, interval = fit(passes(lambda v: 0.8, 0.0, 0.15, seed), SPEEDS).friction[1]
        held += abs(value - 0.8) <= interval
    assert held >= 180


def test_no_friction_is_fitted_below_none():
    found = fit(passes(lambda v: 0.6 - 0.5 * v, 0.0), SPEEDS)
    assert min(found.dry[0], found.smooth[0]) >= 0.0


@pytest.mark.parametrize(("freedom", "published"), [(3, 3.182), (6, 2.447), (30, 2.042)])
def test_the_quantile_is_students(freedom, published):
    assert student(freedom) == pytest.approx(published, rel=0.01)
