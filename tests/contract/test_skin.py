"""Contract of every skin; nothing touches the one on the bench."""

from itertools import pairwise

import numpy as np
import pytest

from drivers.errors import SkinSilentError
from drivers.skin.layout import shape_of


@pytest.fixture
def opened(skin_bench):
    skin_bench.device.open()
    return skin_bench


def scanned(bench, seconds):
    """Yield each frame read every 10 ms for `seconds`, its age when it is read, and the duration of the reading, s."""
    for _ in range(round(seconds / 0.01)):
        bench.clock.wait_until(bench.clock.now() + 0.01)
        now = bench.clock.now()
        frame = bench.device.read()
        yield frame, now - frame.stamp, bench.clock.now() - now


def test_frames_of_an_untouched_skin_are_whole_fresh_and_about_zero(opened):
    first = opened.device.read()
    assert first.values.shape == first.trusted.shape == shape_of("parallelogram")
    assert (first.values.dtype, first.trusted.dtype) == (np.float64, np.bool_)
    assert first.trusted.mean() > 0.9
    before = first.values.copy()
    frames = []
    for frame, age, waited in scanned(opened, 3.0):
        frames.append(frame)
        assert -1e-9 < age < 0.35
        assert waited < 0.005
    values = np.array([frame.values for frame in frames])
    assert np.isfinite(values).all()
    assert abs(values.mean()) < 100.0
    assert (np.abs(values) < 5000.0).all()
    assert len({frame.sequence for frame in frames}) >= 27  # ten a second, or nearly
    steps = [(b.sequence - a.sequence, b.stamp - a.stamp) for a, b in pairwise(frames)]
    assert all((ds > 0) == (dt > 0.0) and ds >= 0 for ds, dt in steps)
    assert (first.values == before).all()  # shared with no later one


def test_a_skin_may_be_opened_and_closed_twice_and_opened_again(opened):
    opened.device.open()
    opened.device.read()
    opened.device.close()
    opened.device.close()
    opened.device.open()
    assert np.isfinite(opened.device.read().values).all()


def test_silence_is_a_fault_of_its_own_and_lasts_as_long(opened):
    if opened.silence is None:
        pytest.skip("nobody here can make it silent")
    opened.silence()
    opened.clock.wait_until(opened.clock.now() + 0.5)
    for _ in range(3):
        with pytest.raises(SkinSilentError):
            opened.device.read()
        opened.clock.wait_until(opened.clock.now() + 0.5)
