"""Contract of every skin; nothing touches the one on the bench."""

from itertools import pairwise

import numpy as np
import pytest

from drivers.errors import SkinSilentError
from drivers.skin.layout import shape_of


@pytest.fixture
def opened(skin_bench):
    """Yield the bench with its skin open."""
    skin_bench.device.open()
    return skin_bench


def scanned(bench, seconds, period=0.01):
    """Yield what scans for so long read."""
    for _ in range(round(seconds / period)):
        bench.clock.wait_until(bench.clock.now() + period)
        yield bench.device.read()


def test_frame_has_two_fingers_of_finite_signed_values_and_a_mask(opened):
    frame = opened.device.read()
    assert frame.values.shape == frame.trusted.shape == shape_of("parallelogram")
    assert (frame.values.dtype, frame.trusted.dtype) == (np.float64, np.bool_)
    assert np.isfinite(frame.values).all()


def test_untouched_skin_reads_about_zero(opened):
    values = np.array([frame.values for frame in scanned(opened, 3.0)])
    assert abs(values.mean()) < 100.0
    assert (np.abs(values) < 5000.0).all()


def test_most_taxels_can_be_trusted(opened):
    assert opened.device.read().trusted.mean() > 0.9


def test_reading_never_waits(opened):
    before = opened.clock.now()
    opened.device.read()
    assert opened.clock.now() - before < 0.005


def test_stamps_are_of_the_past_and_fresh(opened):
    ages = [opened.clock.now() - frame.stamp for frame in scanned(opened, 2.0)]
    assert min(ages) > -1e-9
    assert max(ages) < 0.35


def test_stamps_and_sequence_go_on_together(opened):
    frames = scanned(opened, 2.0)
    steps = [(b.sequence - a.sequence, b.stamp - a.stamp) for a, b in pairwise(frames)]
    assert all((ds > 0) == (dt > 0.0) and ds >= 0 for ds, dt in steps)


def test_ten_frames_a_second_or_more_come(opened):
    frames = list(scanned(opened, 2.0))
    assert len({frame.sequence for frame in frames}) >= 18


def test_opening_and_closing_again_is_harmless(opened):
    opened.device.open()
    opened.device.read()
    opened.device.close()
    opened.device.close()


def test_skin_that_was_closed_can_be_opened_again(opened):
    opened.device.close()
    opened.device.open()
    assert np.isfinite(opened.device.read().values).all()


def test_frames_are_not_shared_with_later_ones(opened):
    frame = opened.device.read()
    before = frame.values.copy()
    list(scanned(opened, 0.5))
    assert (frame.values == before).all()


def test_silence_is_a_fault_of_its_own_and_lasts_as_long(opened):
    if opened.silence is None:
        pytest.skip("nobody here can make it silent")
    opened.silence()
    opened.clock.wait_until(opened.clock.now() + 0.5)
    for _ in range(3):
        with pytest.raises(SkinSilentError):
            opened.device.read()
        opened.clock.wait_until(opened.clock.now() + 0.5)
