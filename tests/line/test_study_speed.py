"""The study of speed, on a short trial: what it takes apart adds up to the whole."""

import pytest

from cell.config import load
from cell.lab.speed import measure as speed

SHORT = ('sim.pace="max"', "hole.area=[0.002, 0.002]")


@pytest.fixture(autouse=True)
def _one_trial(monkeypatch):
    """Time one trial: how much faster another would be is no matter here."""
    monkeypatch.setattr(speed, "REPEATS", 1)


def test_the_regimes_of_a_trial_add_up_to_the_whole():
    *parts, whole = speed.measure(load(sets=SHORT).cell, 1)
    assert [line.regime for line in parts] == [regime.value for regime in speed.Regime]
    assert sum(line.simulated for line in parts) == pytest.approx(whole.simulated)
    assert sum(line.simulated / line.real_time for line in parts) == pytest.approx(whole.simulated / whole.real_time)
    for line in (*parts, whole):
        assert 0.0 < line.outside == pytest.approx(1e-3 / line.real_time - 1e-3 / line.bare_real_time)


def test_the_profile_of_a_trial_adds_up_to_the_whole():
    parts = speed.profile(load(sets=SHORT).cell, 1)
    assert sum(part.share for part in parts) == pytest.approx(1.0)
    solver = next(part for part in parts if part.part == "mj_step: solver")
    assert solver.share > 0.05
