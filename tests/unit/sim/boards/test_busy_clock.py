"""A busy computer wakes late, and never early."""

import numpy as np
import pytest

from sim.boards.busy_clock import BusyClock
from sim.world.reality import AS_BELIEVED
from tests.skins import ScriptedWorld


def lateness(probability: float, delay: float, scans: int = 4000) -> np.ndarray:
    drawn = {**AS_BELIEVED, "scan.late": np.array(probability), "scan.delay": np.array(delay)}
    clock = BusyClock(ScriptedWorld(), drawn, np.random.default_rng(1))
    late = []
    for _ in range(scans):
        due = clock.now() + 0.01
        clock.wait_until(due)
        late.append(clock.now() - due)
    return np.array(late)


@pytest.mark.parametrize(("share", "delay"), [(0.0, 0.01), (0.1, 0.005), (0.5, 0.008)])
def test_scans_are_late_as_often_and_as_much_as_was_asked_for(share, delay):
    late = lateness(share, delay)
    assert late.min() >= 0.0
    assert (late > 0.0).mean() == pytest.approx(share, abs=0.02)
    assert not share or late[late > 0.0].mean() == pytest.approx(delay, rel=0.1)
