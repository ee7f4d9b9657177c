import math

import pytest

from cell.records.statistics import RateTest, Verdict, spread, wilson


def test_interval_of_the_published_rate():
    assert wilson(38, 40) == pytest.approx((0.835, 0.986), abs=5e-4)


@pytest.mark.parametrize(("successes", "attempts"), [(0, 1), (1, 1), (7, 40), (200, 200)])
def test_interval_solves_the_score_equation(successes, attempts):
    share = successes / attempts
    for bound in wilson(successes, attempts):
        if 0.0 < bound < 1.0:
            deviation = abs(share - bound) / math.sqrt(bound * (1 - bound) / attempts)
            assert deviation == pytest.approx(1.959964, abs=1e-5)


def test_nothing_tried_says_nothing_and_the_tail_is_told():
    assert (wilson(0, 0), spread([])) == ((0.0, 1.0), None)
    assert spread([1.0] * 99 + [100.0])["p95"] == 1.0


def test_the_interval_holds_the_rate_itself_however_it_rounds():
    for attempts in range(1, 400):
        for successes in (0, 1, attempts - 1, attempts):
            low, high = wilson(successes, attempts)
            assert 0.0 <= low <= successes / attempts <= high <= 1.0


TEST = RateTest(good=0.02, bad=0.25, least=6)
MOST = 80


@pytest.mark.parametrize(
    ("lost", "trials", "verdict"),
    [(0, 11, "undecided"), (0, 12, "good"), (1, 13, "undecided"), (5, 5, "undecided"), (2, 6, "bad"), (6, 6, "bad")],
)
def test_a_setting_is_judged_after_so_many_trials(lost, trials, verdict):
    assert TEST.verdict(lost, trials) == verdict


def endings(test: RateTest, share: float) -> dict[tuple[int, int], float]:
    """Return the probability of each ending (lost, trials) at a true share of lost trials, exactly."""
    ends: dict[tuple[int, int], float] = {}
    going = {0: 1.0}
    for trials in range(1, MOST + 1):
        reached: dict[int, float] = {}
        for lost, chance in going.items():
            for more, of in ((0, 1.0 - share), (1, share)):
                reached[lost + more] = reached.get(lost + more, 0.0) + chance * of
        is_last = trials == MOST
        ends |= {(k, trials): c for k, c in reached.items() if is_last or test.verdict(k, trials) is not Verdict.OPEN}
        going = {k: c for k, c in reached.items() if (k, trials) not in ends}
    return ends


@pytest.mark.parametrize(("share", "wrong"), [(TEST.good, Verdict.BAD), (TEST.bad, Verdict.GOOD)])
def test_a_wrong_answer_is_as_rare_as_asked(share, wrong):
    found = sum(chance for end, chance in endings(TEST, share).items() if TEST.verdict(*end) is wrong)
    assert found <= TEST.error / (1.0 - TEST.error)


def coverage(test: RateTest, share: float) -> float:
    """Return how often the Wilson interval of an ending holds the true share, exactly."""
    return sum(
        chance
        for (lost, trials), chance in endings(test, share).items()
        if wilson(lost, trials)[0] <= share <= wilson(lost, trials)[1]
    )


@pytest.mark.parametrize("test", [RateTest(good=0.02, bad=0.25, least=6), RateTest(good=0.01, bad=0.05, least=8)])
def test_wilson_intervals_where_a_test_ends_hold_the_true_share_in_at_least_85_percent(test):
    assert min(coverage(test, share / 1000) for share in (2, 5, 10, 15, *range(20, 1000, 60))) > 0.85
