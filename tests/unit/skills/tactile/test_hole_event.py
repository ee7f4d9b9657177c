import numpy as np
import pytest

from drivers.quantities import TaxelFrame
from skills.tactile.hole_event import HoleEvent, HoleEventParams


def _frame(level, number, trusted=None):
    trusted = np.ones((2, 20), dtype=bool) if trusted is None else trusted
    return TaxelFrame(np.full((2, 20), level), trusted, 0.1 * number, number)


def _events(levels, **params):
    event = HoleEvent(HoleEventParams(**params))
    return [number for number, level in enumerate(levels) if event.update(_frame(float(level), number))]


@pytest.mark.parametrize(("fall", "events"), [(0.10, []), (0.101, [8])])
def test_fall_counts_beyond_the_threshold_and_not_at_it(fall, events):
    assert _events([1000.0] * 8 + [1000.0 * (1 - fall)] * 4, threshold=0.1) == events


def test_rise_is_no_event():
    assert _events([1000.0] * 8 + [2000.0] * 4, threshold=0.1) == []


@pytest.mark.parametrize(("span", "is_seen"), [(1, False), (3, True)])
def test_slow_fall_is_seen_over_three_frames_and_not_over_one(span, is_seen):
    slow = [1000.0] * 8 + [960.0, 920.0, 880.0, 880.0]
    assert bool(_events(slow, threshold=0.1, span=span)) == is_seen


def test_sum_of_falls_sees_what_no_difference_does():
    slow = [1000.0] * 10 + [950.0] * 5
    assert _events(slow, threshold=0.08, method="cusum")
    assert not _events(slow, threshold=0.08, span=3)


def test_event_is_reported_once():
    assert len(_events([1000.0] * 8 + [500.0] * 8, threshold=0.1, span=3)) == 1


def test_taxels_that_drop_out_are_no_fall():
    half = np.arange(40).reshape(2, 20) % 2 == 0
    values = np.where(half, 4000.0, 100.0)
    event = HoleEvent(HoleEventParams(threshold=0.05))
    whole = [TaxelFrame(values, np.ones((2, 20), dtype=bool), 0.1 * k, k) for k in range(5)]
    rest = TaxelFrame(np.where(half, 0.0, values), ~half, 0.5, 5)
    assert not any(event.update(frame) for frame in [*whole, rest])


def test_skin_that_feels_nothing_shows_no_event():
    rng = np.random.default_rng(0)
    assert _events(-np.abs(rng.normal(size=50)), threshold=0.1) == []


def test_event_carries_the_time_of_its_frame():
    event = HoleEvent(HoleEventParams(threshold=0.1))
    for number, level in enumerate([1000.0, 1000.0, 700.0, 700.0]):
        event.update(_frame(level, number))
    assert (event.count, event.stamp) == (1, pytest.approx(0.2))
