"""A search whose first point happens to be the hole."""

import math

import numpy as np
import pytest

from cell.assembly import assemble, opened
from cell.config import load
from skills import catalogue, spray_search
from skills.contract import Outcome


class StartAt:
    """Random numbers of which the first is known."""

    def __init__(self, point: np.ndarray) -> None:
        self._point = point

    def uniform(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        return self._point


@pytest.mark.parametrize("seed", [101, 102, 103, 104])
def test_peg_that_comes_down_right_into_the_hole_climbs_out_and_is_led_back(seed: int) -> None:
    config = load(None, None, ["sim.pace=max", f"sim.seed={seed}"]).cell
    cell = assemble(config)
    assert cell.truth is not None
    with opened(cell):
        ctx = cell.context(seed)
        catalogue.grasp(config.skill_set(), ctx)
        hole = np.array(cell.truth().hole)
        ctx.rng = StartAt(hole[:2] - np.array(config.hole.centre[:2]))  # type: ignore[assignment]
        found = spray_search.run(config.search, ctx)
        edge = spray_search.lowest_point(np.array(cell.truth().tip), ctx.observe().axis, config.peg.diameter / 2)
    assert found.outcome is Outcome.SUCCESS
    assert found.elapsed < 4.0
    assert math.dist(edge[:2], hole[:2]) < config.hole.diameter / 2
    assert hole[2] - edge[2] > config.search.fall
