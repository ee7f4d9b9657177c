import math

import numpy as np
import pytest

from drivers.quantities import TaxelFrame
from skills.tactile.hole_event import HoleEvent, HoleEventParams, normal_limit, page_limit

LEVEL, NOISE, PERIOD, HORIZON = 1000.0, 40.0, 0.1, 100.0
DERIVED = ["difference", "cusum"]


def _frame(level, number, trusted=None):
    trusted = np.ones((2, 20), dtype=bool) if trusted is None else trusted
    return TaxelFrame(np.full((2, 20), level), trusted, PERIOD * number, number)


def _events(levels, **params):
    event = HoleEvent(HoleEventParams(**params), HORIZON)
    return [number for number, level in enumerate(levels) if event.update(_frame(float(level), number))]


def _noise(frames, seed=3):
    return LEVEL + NOISE * np.random.default_rng(seed).standard_normal(frames)


@pytest.mark.parametrize(("change", "events"), [(-0.10, []), (-0.101, [8]), (0.10, []), (0.101, [8])])
def test_printed_change_either_way_counts_beyond_the_threshold_and_not_at_it(change, events):
    levels = [1000.0] * 8 + [1000.0 * (1 + change)] * 4
    assert _events(levels, method="derivative", threshold=0.1) == events


@pytest.mark.parametrize("false_alarms", [1.0, 4.0])
def test_sum_raises_as_many_false_alarms_as_stated(false_alarms):
    searches = 15
    expected = searches * false_alarms
    found = sum(
        len(_events(_noise(round(HORIZON / PERIOD), seed), method="cusum", false_alarms=false_alarms))
        for seed in range(searches)
    )
    # Three standard deviations of a Poisson count, and the tenth by which the approximation may be off.
    assert abs(found - expected) < 3.0 * math.sqrt(expected) + 0.1 * expected


def test_difference_raises_no_more_false_alarms_than_stated_and_not_far_fewer():
    found = sum(
        len(_events(_noise(round(HORIZON / PERIOD), seed), method="difference", false_alarms=3.0)) for seed in range(15)
    )
    assert 10 < found < 45 + 3.0 * math.sqrt(45)


@pytest.mark.parametrize(("slack", "run_length"), [(0.5, 500), (1.0, 500), (1.0, 5000)])
def test_sum_over_white_noise_has_the_run_length_asked_for(slack, run_length):
    rng, limit = np.random.default_rng(1), page_limit(slack, run_length)
    sums, alarms, scans, runs = np.zeros(1000), 0, 4000, 1000
    for _ in range(scans):
        sums = np.maximum(sums + rng.standard_normal(runs) - slack, 0.0)
        alarms += int(np.count_nonzero(sums > limit))
        sums[sums > limit] = 0.0
    assert scans * runs / alarms == pytest.approx(run_length, rel=0.1)


def test_rarer_alarms_ask_for_higher_limits():
    assert page_limit(1.0, 1e4) < page_limit(1.0, 1e6)
    assert normal_limit(1e-3) < normal_limit(1e-6)
    assert normal_limit(0.05) == pytest.approx(1.96, abs=1e-3)


@pytest.mark.parametrize(("steps", "least"), [(1.0, 21), (2.0, 30)])
@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_sum_finds_most_changes_of_the_stated_step_and_all_of_twice_that(way, steps, least):
    found = 0
    for seed in range(30):
        levels = _noise(110, seed)
        levels[100:] += way * steps * 3.0 * NOISE
        found += any(number >= 100 for number in _events(levels, method="cusum", step=3.0))
    assert found >= least


@pytest.mark.parametrize("method", DERIVED)
@pytest.mark.parametrize("change", [-0.4, 0.4])
def test_sudden_change_either_way_is_found_at_once(method, change):
    levels = _noise(60)
    levels[40:] *= 1.0 + change
    events = _events(levels, method=method)
    assert len(events) == 1
    assert events[0] in (40, 41)


@pytest.mark.parametrize("method", DERIVED)
def test_noise_known_from_few_frames_is_not_believed(method):
    found = sum(len(_events(_noise(12, seed), method=method, false_alarms=1.0)) for seed in range(200))
    assert found < 200 * 12 / 1000 * 3


@pytest.mark.parametrize("method", DERIVED)
def test_another_load_after_a_restart_is_no_event(method):
    event = HoleEvent(HoleEventParams(method=method), HORIZON)
    levels = _noise(60)
    levels[40:] *= 2.0
    for number, level in enumerate(levels):
        if number == 40:
            event.restart()
        event.update(_frame(float(level), number))
    assert event.count == 0


@pytest.mark.parametrize("method", ["derivative", *DERIVED])
def test_event_is_reported_once(method):
    levels = np.concatenate([_noise(40), 0.5 * _noise(12)])
    assert len(_events(levels, method=method, threshold=0.3)) == 1


def test_ten_times_the_frames_leave_the_rate_in_a_search_as_it_is():
    limits = []
    for period in (0.1, 0.01):
        event = HoleEvent(HoleEventParams(method="difference", false_alarms=1e-3), HORIZON)
        for number in range(20):
            event.take(TaxelFrame(np.full((2, 20), LEVEL), np.ones((2, 20), dtype=bool), period * number, number))
        limits.append(event.limit())
    assert limits == pytest.approx([normal_limit(1e-6), normal_limit(1e-7)])


@pytest.mark.parametrize("method", ["derivative", *DERIVED])
def test_taxels_that_drop_out_are_no_change(method):
    half = np.arange(40).reshape(2, 20) % 2 == 0
    rng = np.random.default_rng(2)
    event = HoleEvent(HoleEventParams(method=method, threshold=0.2), HORIZON)
    for number in range(40):
        values = np.where(half, 4000.0, 100.0) + 10.0 * rng.standard_normal((2, 20))
        is_whole = number < 30
        frame = TaxelFrame(values if is_whole else np.where(half, 0.0, values), ~half | is_whole, 0.1 * number, number)
        assert not event.update(frame)


@pytest.mark.parametrize("method", ["derivative", *DERIVED])
def test_skin_that_feels_nothing_shows_no_event(method):
    rng = np.random.default_rng(0)
    assert _events(-np.abs(rng.normal(size=50)), method=method, threshold=0.1) == []


def test_event_carries_the_time_of_its_frame():
    event = HoleEvent(HoleEventParams(method="derivative", threshold=0.1), HORIZON)
    for number, level in enumerate([1000.0, 1000.0, 700.0, 700.0]):
        event.update(_frame(level, number))
    assert (event.count, event.stamp) == (1, pytest.approx(0.2))
