"""Contract of every clock."""

import pytest


def test_time_goes_on_to_where_it_is_waited_for(clock):
    stamp = clock.now() + 0.05
    clock.wait_until(stamp)
    assert clock.now() == pytest.approx(stamp, abs=1e-3)


def test_waiting_for_the_past_takes_no_time(clock):
    clock.wait_until(clock.now() + 0.01)
    before = clock.now()
    clock.wait_until(before - 1.0)
    assert clock.now() == pytest.approx(before, abs=1e-3)


def test_time_never_goes_back(clock):
    times = []
    for step in (0.01, 0.0, -0.01, 0.003):
        clock.wait_until(clock.now() + step)
        times.append(clock.now())
    assert times == sorted(times)
