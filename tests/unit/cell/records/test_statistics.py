"""The Wilson interval solves the score equation and contains the rate."""

import math

import pytest

from cell.records.statistics import spread, wilson


def test_interval_of_the_published_rate():
    assert wilson(38, 40) == pytest.approx((0.835, 0.986), abs=5e-4)


@pytest.mark.parametrize(("successes", "attempts"), [(0, 1), (1, 1), (7, 40), (200, 200)])
def test_interval_solves_the_score_equation(successes, attempts):
    share = successes / attempts
    for bound in wilson(successes, attempts):
        if 0.0 < bound < 1.0:
            deviation = abs(share - bound) / math.sqrt(bound * (1 - bound) / attempts)
            assert deviation == pytest.approx(1.959964, abs=1e-5)


def test_no_trials_give_the_widest_interval_and_no_spread():
    assert (wilson(0, 0), spread([])) == ((0.0, 1.0), None)
    assert spread([1.0] * 99 + [100.0])["p95"] == 1.0


def test_the_interval_contains_the_rate_at_any_rounding():
    for attempts in range(1, 400):
        for successes in (0, 1, attempts - 1, attempts):
            low, high = wilson(successes, attempts)
            assert 0.0 <= low <= successes / attempts <= high <= 1.0
