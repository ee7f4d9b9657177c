import math

import pytest

from cell.statistics import Tried, spread, stage_table, wilson


def test_interval_of_the_published_rate():
    assert wilson(38, 40) == pytest.approx((0.835, 0.986), abs=5e-4)


@pytest.mark.parametrize(("successes", "attempts"), [(0, 1), (1, 1), (7, 40), (200, 200)])
def test_interval_solves_the_score_equation(successes, attempts):
    share = successes / attempts
    for bound in wilson(successes, attempts):
        if 0.0 < bound < 1.0:
            deviation = abs(share - bound) / math.sqrt(bound * (1 - bound) / attempts)
            assert deviation == pytest.approx(1.959964, abs=1e-5)


def test_nothing_tried_says_nothing():
    assert wilson(0, 0) == (0.0, 1.0)


def test_a_stage_succeeds_when_another_follows():
    lost_in_search = Tried(False, "spray_search", {"spray_search": 100.0})
    lost_in_insert = Tried(False, "tactile_insert", {"spray_search": 10.0, "tactile_insert": 60.0})
    good = Tried(True, "release_and_retract", {"spray_search": 20.0, "tactile_insert": 5.0, "spiral_adjust": 3.0})
    search, insert, adjust, total = stage_table([lost_in_search, lost_in_insert, good])
    assert [(line.successes, line.attempts) for line in (search, insert, adjust, total)] == [
        (2, 3),
        (1, 2),
        (1, 1),
        (1, 3),
    ]
    assert (search.time, insert.time, total.time) == (15.0, 5.0, 28.0)


def test_spread_of_nothing_is_nothing():
    assert spread([]) is None


def test_spread_tells_the_tail():
    assert spread([1.0] * 99 + [100.0])["p95"] == 1.0


def test_the_interval_holds_the_rate_itself_however_it_rounds():
    for attempts in range(1, 400):
        for successes in (0, 1, attempts - 1, attempts):
            low, high = wilson(successes, attempts)
            assert 0.0 <= low <= successes / attempts <= high <= 1.0
