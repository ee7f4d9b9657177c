"""Where a search begins: beside where the hole may be, so that the plate is felt before the hole is."""

import numpy as np
import pytest

from cell.assembly import assemble, opened
from cell.config import load
from skills import catalogue, spray_search
from skills.contract import Outcome


@pytest.mark.parametrize("seed", [101, 102, 103, 104])
def test_peg_comes_down_beside_a_hole_that_is_known_to_a_millimetre(seed: int) -> None:
    config = load(
        None, None, ["sim.pace=max", f"sim.seed={seed}", "hole.area=[0.001, 0.001]", "search.margin=[0.0, 0.0]"]
    ).cell
    cell = assemble(config)
    assert cell.truth is not None
    heights = []
    with opened(cell):
        ctx = cell.context(seed)
        catalogue.grasp(config.skill_set(), ctx)

        def watch(seen, setpoint):
            edge = spray_search.lowest_point(seen.tip, seen.axis, config.peg.diameter / 2)
            if seen.arm.wrench.force[2] > 3.0:
                heights.append(edge[2] - cell.truth().hole[2])

        ctx.record = watch
        found = spray_search.run(config.search, ctx)
        edge = spray_search.lowest_point(np.array(cell.truth().tip), ctx.observe().axis, config.peg.diameter / 2)
        hole = np.array(cell.truth().hole)
    assert abs(heights[0]) < 5e-4
    assert found.outcome is Outcome.SUCCESS
    assert found.elapsed < 2.5
    assert np.hypot(*(edge - hole)[:2]) < config.hole.diameter / 2
    assert hole[2] - edge[2] > config.search.fall
