from functools import lru_cache

import numpy as np
import pytest

from drivers.skin.layout import LAYOUTS, MODULE_OF
from skills.tactile.pca import BINS, PcaEstimator, PcaParams
from tests.pegs import ALL, rms_degrees, shipped, swept


@lru_cache
def _estimator(layout):
    return PcaEstimator(PcaParams(), layout, shipped().peg)


@pytest.mark.parametrize(("layout", "rms"), [("parallelogram", 2.0), ("base_to_base", 4.0)])
def test_theta_follows_the_peg_over_the_whole_range(layout, rms):
    error, sigma, _, healthy = swept(_estimator(layout), layout)
    assert healthy.mean() > 0.97
    assert rms_degrees(error) < rms
    assert np.mean(np.abs(error) < 1.96 * sigma) > 0.88


@pytest.mark.parametrize("layout", LAYOUTS)
def test_table_takes_away_most_of_what_the_lattice_adds(layout, monkeypatch):
    with_table, _, _, _ = swept(_estimator(layout), layout)
    bare = PcaEstimator(PcaParams(), layout, shipped().peg)
    monkeypatch.setattr(bare, "_table", lambda trusted: (np.zeros(BINS), np.full(BINS, 0.01)))
    without, _, _, _ = swept(bare, layout)
    assert rms_degrees(with_table) < 0.8 * rms_degrees(without)


def test_table_is_the_same_every_time():
    again = PcaEstimator(PcaParams(), "parallelogram", shipped().peg)
    for one, other in zip(again._table(ALL.ravel()), _estimator("parallelogram")._table(ALL.ravel()), strict=True):
        assert np.array_equal(one, other)


@pytest.mark.parametrize("module", range(4))
def test_known_dead_module_has_a_table_of_its_own(module):
    error, _, _, healthy = swept(_estimator("parallelogram"), "parallelogram", lambda _, v: (v, module != MODULE_OF))
    assert healthy.mean() > 0.95
    assert rms_degrees(error[healthy > 0]) < 4.0


def test_offset_is_positive_to_the_left_of_the_axis():
    _, _, beside, _ = swept(_estimator("parallelogram"), "parallelogram")
    assert beside.std() < 1e-3
