"""A busy computer wakes late, and never early."""

import numpy as np
import pytest

from sim.boards.busy_clock import BusyClock
from sim.world.reality import AS_BELIEVED


class CountedClock:
    def __init__(self) -> None:
        self.time = 0.0

    def now(self) -> float:
        return self.time

    def wait_until(self, stamp: float) -> None:
        self.time = max(self.time, stamp)


def lateness(probability: float, delay: float, scans: int = 4000) -> np.ndarray:
    drawn = {**AS_BELIEVED, "scan.late": np.array(probability), "scan.delay": np.array(delay)}
    clock = BusyClock(CountedClock(), drawn, np.random.default_rng(1))
    late = []
    for _ in range(scans):
        due = clock.now() + 0.01
        clock.wait_until(due)
        late.append(clock.now() - due)
    return np.array(late)


def test_a_computer_that_is_not_busy_is_never_late():
    assert not lateness(0.0, 0.01).any()


def test_the_share_of_late_scans_is_the_one_that_was_asked_for():
    late = lateness(0.1, 0.005)
    assert (late > 0.0).mean() == pytest.approx(0.1, abs=0.02)
    assert late.min() >= 0.0


def test_late_scans_are_late_by_the_mean_that_was_asked_for():
    late = lateness(0.5, 0.008)
    assert late[late > 0.0].mean() == pytest.approx(0.008, rel=0.1)
