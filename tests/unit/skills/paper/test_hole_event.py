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


FEW = np.arange(40).reshape(2, 20) < 9


@pytest.mark.parametrize(
    ("levels", "trusted", "found"),
    [
        ([1000.0] * 8 + [900.0] * 4, None, []),
        ([1000.0] * 8 + [899.0] * 4, None, [8]),
        ([1000.0] * 8 + [1100.0] * 4, None, []),
        ([1000.0] * 8 + [1101.0] * 4, None, [8]),
        (1000.0 * 1.05 ** np.arange(20), None, []),
        (-np.abs(np.random.default_rng(0).normal(size=50)), None, []),
        ([1000.0], None, []),
        ([1000.0, 10.0], FEW, []),
    ],
    ids=["at", "beyond", "at, upwards", "beyond, upwards", "slow", "no average", "first frame", "few taxels trusted"],
)
def test_only_a_sudden_change_beyond_the_threshold_is_an_event(levels, trusted, found):
    assert events(levels, trusted) == found


def test_taxels_that_drop_out_are_no_change():
    half = np.arange(40).reshape(2, 20) % 2 == 0
    event = HoleEvent(THRESHOLD)
    for number in range(40):
        is_whole = number < 30
        values = np.where(half & is_whole, 4000.0, 100.0)
        assert not event.update(TaxelFrame(values, ~half | is_whole, 0.1 * number, number))
