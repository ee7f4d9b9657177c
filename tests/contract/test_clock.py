"""Contract of every clock."""

import pytest


def test_time_passes_by_the_wait_and_never_back(clock):
    begun = clock.now()
    for step in (0.05, 0.01, 0.0, -1.0, 0.003):
        before = clock.now()
        clock.wait_until(before + step)
        assert clock.now() >= before
        assert clock.now() == pytest.approx(before + max(step, 0.0), abs=1e-3)
    assert clock.now() == pytest.approx(begun + 0.063, abs=3e-3)
