"""A simulated cell draws the place of its fixture."""

import numpy as np
import pytest

from cell.config.load import load
from cell.devices.assembly import assemble


def holes(sets: list[str], count: int) -> np.ndarray:
    """Return where the hole is for so many parts on one simulated cell, shape (count, 2), m."""
    cell = assemble(load(sets=sets).cell)
    assert cell.truth is not None
    found = []
    for seed in range(count):
        cell.restock(cell.config.job(), seed)
        found.append(cell.truth().hole[:2])
    return np.array(found)


def test_holes_of_a_fixture_scatter_about_its_place_within_the_area():
    found = holes(["sim.fixture={mean=[0.51,0.0299],deviation=0.0005}"], 60)
    assert found.mean(axis=0)[0] == pytest.approx(0.51, abs=2e-4)
    assert found.std(axis=0)[0] == pytest.approx(5e-4, rel=0.3)
    assert found[:, 1].max() == pytest.approx(0.03)


def test_a_fixture_without_a_place_is_placed_by_the_first_seed():
    places = [holes(["sim.fixture={deviation=0.0}", f"sim.seed={seed}"], 2) for seed in (1, 2)]
    assert np.ptp(places[0], axis=0) == pytest.approx(np.zeros(2))
    assert np.linalg.norm(places[0][0] - places[1][0]) > 1e-3
