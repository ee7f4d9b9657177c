"""Learning the place of a fixture from part to part: found, drifting, exchanged; a single outlier changes nothing."""

import math

import numpy as np
import pytest

from drivers.parts import HolePrior
from skills.search.prior import NEEDED, LearningConfig, PlaceEstimate, first_estimate, from_prior

LEARNING = LearningConfig()
HOME, AWAY = (0.51, 0.012), (0.48, -0.02)


def after(holes: "np.ndarray | list[tuple[float, float]]", known: PlaceEstimate | None = None) -> PlaceEstimate:
    """Return what is known after holes, one a part, m."""
    for x, y in holes:
        hole = float(x), float(y)
        known = first_estimate(hole, LEARNING) if known is None else known.after(hole, LEARNING)
    return known


def holes(place: tuple[float, float], scatter: float, count: int, seed: int = 1) -> np.ndarray:
    """Return holes about a place, shape (count, 2), m."""
    return place + np.random.default_rng(seed).normal(0.0, scatter, (count, 2))


def test_a_place_is_unknown_until_parts_agree():
    assert after([HOME] * (NEEDED - 1)).prior(LEARNING) is None
    told = after([HOME] * NEEDED).prior(LEARNING)
    assert told.mean == pytest.approx(HOME)


@pytest.mark.parametrize("scatter", [2e-4, 5e-4, 1e-3])
def test_nineteen_of_twenty_holes_lie_where_they_are_expected(scatter):
    inside = parts = 0
    for seed in range(20):
        known = after(holes(HOME, scatter, 10, seed))
        for hole in holes(HOME, scatter, 20, 100 + seed):
            prior = known.prior(LEARNING)
            if prior is not None:
                off = math.hypot(*((h - m) / d for h, m, d in zip(hole, prior.mean, prior.deviation, strict=True)))
                inside, parts = inside + (off < 2.45), parts + 1
            known = known.after((float(hole[0]), float(hole[1])), LEARNING)
    assert parts > 380
    assert inside / parts > 0.9


def test_the_deviation_is_that_of_the_parts_or_the_arm():
    told, equal = after(holes(HOME, 5e-4, 60)).prior(LEARNING), after([HOME] * 100).prior(LEARNING)
    assert told.deviation == pytest.approx((5e-4, 5e-4), rel=0.4)
    assert min(equal.deviation) >= LEARNING.finest


def test_a_fixture_that_drifts_is_followed():
    drifting = [(HOME[0] + 1e-4 * n, HOME[1]) for n in range(60)]
    told = after(drifting).prior(LEARNING)
    assert abs(told.mean[0] - drifting[-1][0]) < 1e-3


@pytest.mark.parametrize("settled", [HOME, AWAY], ids=["stray", "new fixture"])
def test_one_part_elsewhere_widens_and_the_next_decides(settled):
    known = after(holes(HOME, 5e-4, 10)).after(AWAY, LEARNING)
    assert known.prior(LEARNING) is None
    told = known.after((settled[0] + 4e-4, settled[1]), LEARNING).prior(LEARNING)
    assert math.dist(told.mean, settled) < 5e-4


def test_holes_anywhere_teach_nothing():
    anywhere = np.random.default_rng(2).uniform(-0.03, 0.03, (200, 2))
    known, told = first_estimate((0.0, 0.0), LEARNING), 0
    for x, y in anywhere:
        known = known.after((float(x), float(y)), LEARNING)
        told += known.prior(LEARNING) is not None
    assert told < 30


@pytest.mark.parametrize(("distance", "fits"), [(3.9, True), (4.1, False)])
def test_the_gate_is_where_the_config_says(distance, fits):
    known = first_estimate(HOME, LEARNING)
    deviation = math.sqrt(2.0 * LEARNING.scatter**2 + LEARNING.drift**2)
    assert known.fits((HOME[0] + distance * deviation, HOME[1]), LEARNING) is fits


def test_a_configured_prior_holds_until_parts_disagree():
    prior = HolePrior(mean=HOME, deviation=(2e-3, 3e-4))
    told = from_prior(prior, LEARNING).prior(LEARNING)
    assert told.mean == HOME
    assert told.deviation == pytest.approx(prior.deviation, rel=0.1)
    assert from_prior(prior, LEARNING).after(AWAY, LEARNING).prior(LEARNING) is None
