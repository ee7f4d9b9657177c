"""Tests of a success rate err as rarely as stated, and intervals contain it as often."""

from types import SimpleNamespace

import pytest

from cell.lab.rate_test import LevelTest, RateTest, Verdict
from cell.records.statistics import wilson

LOST, KEPT = SimpleNamespace(outcome="failure"), SimpleNamespace(outcome="success")
TEST = RateTest(good=0.02, bad=0.25, least=6)
MOST = 80


@pytest.mark.parametrize(
    ("lost", "trials", "verdict"),
    [(0, 11, "undecided"), (0, 12, "good"), (1, 13, "undecided"), (5, 5, "undecided"), (2, 6, "bad"), (6, 6, "bad")],
)
def test_a_setting_is_judged_after_so_many_trials(lost, trials, verdict):
    assert TEST.verdict(lost, trials) == verdict


def is_open(test: RateTest | LevelTest, lost: int, trials: int) -> bool:
    return not test.is_answered([LOST] * lost + [KEPT] * (trials - lost))


def endings(test: RateTest | LevelTest, share: float, most: int = MOST) -> dict[tuple[int, int], float]:
    """Return the probability of each ending (lost, trials) at a true share of lost trials, exactly."""
    ends: dict[tuple[int, int], float] = {}
    going = {0: 1.0}
    for trials in range(1, most + 1):
        reached: dict[int, float] = {}
        for lost, chance in going.items():
            for more, of in ((0, 1.0 - share), (1, share)):
                reached[lost + more] = reached.get(lost + more, 0.0) + chance * of
        is_last = trials == most
        ends |= {(k, trials): c for k, c in reached.items() if is_last or not is_open(test, k, trials)}
        going = {k: c for k, c in reached.items() if (k, trials) not in ends}
    return ends


@pytest.mark.parametrize(("share", "wrong"), [(TEST.good, Verdict.BAD), (TEST.bad, Verdict.GOOD)])
def test_a_wrong_answer_is_as_rare_as_asked(share, wrong):
    found = sum(chance for end, chance in endings(TEST, share).items() if TEST.verdict(*end) is wrong)
    assert found <= TEST.error / (1.0 - TEST.error)


def coverage(test: RateTest | LevelTest, share: float, most: int = MOST) -> float:
    """Return how often the Wilson interval of an ending contains the true share, exactly."""
    ends = endings(test, share, most).items()
    return sum(chance for end, chance in ends if wilson(*end)[0] <= share <= wilson(*end)[1])


@pytest.mark.parametrize("test", [RateTest(good=0.02, bad=0.25, least=6), RateTest(good=0.01, bad=0.05, least=8)])
def test_wilson_intervals_of_stopped_tests_cover_85_percent(test):
    assert min(coverage(test, share / 1000) for share in (2, 5, 10, 15, *range(20, 1000, 60))) > 0.85


LEVELS = LevelTest((0.5, 0.9), every=20)


@pytest.mark.parametrize(
    ("lost", "trials", "answer"),
    [(0, 35, "90 to 100 %"), (0, 34, ""), (5, 20, "50 to 90 %"), (6, 20, ""), (15, 20, "0 to 50 %"), (14, 20, "")],
)
def test_a_share_is_between_two_levels_if_its_interval_contains_none(lost, trials, answer):
    assert LEVELS.of([LOST] * lost + [KEPT] * (trials - lost)) == answer
    assert is_open(LEVELS, lost, trials) == (answer == "" or trials % 20 != 0)


def test_intervals_contain_the_true_share_as_often_as_stated():
    found = {share: coverage(LEVELS, share / 100, 200) for share in range(2, 99, 2)}
    near = {share for share in found if min(abs(share - 10), abs(share - 50)) <= 4}
    assert min(found[share] for share in near) > 0.81
    assert min(found[share] for share in found.keys() - near) > 0.92
