from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from drivers.skin_layout import LAYOUTS, MODULE_OF
from sim.config import PadConfig
from sim.pads import Pads
from skills.tactile.likelihood import LikelihoodEstimator, LikelihoodParams
from skills.tactile.robust import RobustEstimator, RobustParams
from tests.pegs import ALL, LOAD, SKIN, folded, framed, readings, rms_degrees, shipped, swept


@lru_cache
def _estimator(layout):
    return RobustEstimator(RobustParams(), layout, shipped().peg)


@lru_cache
def _plain(layout):
    return LikelihoodEstimator(LikelihoodParams(), layout, shipped().peg)


def test_whole_skin_is_read_as_well_as_without_second_thoughts():
    error, sigma, _, healthy = swept(_estimator("parallelogram"), "parallelogram")
    assert healthy.all()
    assert rms_degrees(error) < 0.8
    assert np.degrees(np.abs(error).max()) < 5.0
    assert np.mean(np.abs(error) < 1.96 * sigma) > 0.92


@pytest.mark.parametrize("module", range(4))
@pytest.mark.parametrize("reading", [0.0, -5000.0])
def test_module_that_died_unnoticed_costs_no_more_than_a_known_one(module, reading):
    def die(_, values):
        return np.where(module == MODULE_OF, reading, values), ALL

    error, _, _, healthy = swept(_estimator("parallelogram"), "parallelogram", die)
    assert healthy.mean() > 0.99
    assert rms_degrees(error) < 1.2


def test_taxels_that_read_anything_are_left_out():
    def spoil(rng, values):
        values = values.copy()
        values.flat[rng.choice(40, 2, replace=False)] = rng.uniform(5000.0, 15000.0, 2)
        return values, ALL

    error, _, _, healthy = swept(_estimator("parallelogram"), "parallelogram", spoil)
    plain, _, _, _ = swept(_plain("parallelogram"), "parallelogram", spoil)
    assert healthy.mean() > 0.97
    assert rms_degrees(error[healthy > 0]) < min(1.2, 0.6 * rms_degrees(plain))


@pytest.mark.parametrize("layout", LAYOUTS)
def test_peg_with_its_end_between_the_pads_is_read_better(layout):
    rng, errors, plain = np.random.default_rng(8), [], []
    for theta in np.radians(np.linspace(-80.0, 80.0, 161)):
        load = replace(LOAD, theta=theta, reach_back=rng.uniform(0.0, 4e-3))
        frame = framed(readings(layout, load, rng))
        for estimator, found in ((_estimator(layout), errors), (_plain(layout), plain)):
            found.append(folded(estimator.estimate(frame).theta - theta))
    assert rms_degrees(errors) < 0.5 * rms_degrees(plain)


@pytest.mark.parametrize("blur", [0.9e-3, 1.6e-3])
def test_wrong_point_spread_is_survived(blur):
    pads, rng, errors = Pads(PadConfig(blur=blur), "parallelogram"), np.random.default_rng(9), []
    for theta in np.radians(np.linspace(-80.0, 80.0, 161)):
        values = SKIN.sensitivity * pads.pressure(replace(LOAD, theta=theta))
        values = values * rng.normal(1.0, 0.05, values.shape) + rng.normal(0.0, 300.0, values.shape)
        pose = _estimator("parallelogram").estimate(framed(values))
        assert pose.healthy
        errors.append(folded(pose.theta - theta))
    assert rms_degrees(errors) < 1.2
