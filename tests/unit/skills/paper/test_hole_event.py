"""A sudden change of the skin's average shows the hole."""

import numpy as np
import pytest

from drivers.quantities import TaxelFrame
from skills.paper.hole_event import HoleEvent

THRESHOLD = 0.1


def events(levels, trusted=None):
    """Return the numbers of the frames that are events, of frames whose taxels all read the same."""
    event, trusted = HoleEvent(THRESHOLD), np.ones((2, 20), dtype=bool) if trusted is None else trusted
    frames = (TaxelFrame(np.full((2, 20), float(level)), trusted, 0.1 * n, n) for n, level in enumerate(levels))
    return [n for n, frame in enumerate(frames) if event.update(frame)]


@pytest.mark.parametrize(("change", "found"), [(-0.10, []), (-0.101, [8]), (0.10, []), (0.101, [8])])
def test_a_change_either_way_counts_beyond_the_threshold(change, found):
    assert events([1000.0] * 8 + [1000.0 * (1 + change)] * 4) == found


def test_a_slow_change_is_no_event():
    assert events(1000.0 * 1.05 ** np.arange(20)) == []


def test_taxels_that_drop_out_are_no_change():
    half = np.arange(40).reshape(2, 20) % 2 == 0
    event = HoleEvent(THRESHOLD)
    for number in range(40):
        is_whole = number < 30
        values = np.where(half & is_whole, 4000.0, 100.0)
        assert not event.update(TaxelFrame(values, ~half | is_whole, 0.1 * number, number))


@pytest.mark.parametrize("levels", [-np.abs(np.random.default_rng(0).normal(size=50)), [1000.0]])
def test_a_skin_without_a_known_average_shows_no_event(levels):
    assert events(levels) == []


def test_too_few_trusted_taxels_show_no_event():
    few = np.arange(40).reshape(2, 20) < 9
    assert events([1000.0, 10.0], few) == []
