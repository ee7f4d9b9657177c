"""A square peg goes through the whole cell: grasp, search with a corner, turning, seating."""

import math

import pytest

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from cell.lab.trials import run_trial
from sim.world.physics import World
from sim.world.situation import PegSituation
from sim.world.truth import VOID_PENETRATION
from skills import grasp_from_rack
from skills.contract import Outcome

SQUARE = ('sim.pace="max"', "peg.shape=square", "reality.scale=0.0")


@pytest.mark.parametrize(("seed", "yaw"), [(103, ()), (246, ("hole.yaw=0.0",))])
def test_square_pegs_are_seated_quickly_and_gently(seed: int, yaw: tuple[str, ...]) -> None:
    """In a hole turned by an unknown angle, and in one that is known not to be turned."""
    row = run_trial(load(sets=(*SQUARE, "hole.area=[0.01, 0.01]", *yaw)).cell, seed)
    assert (row.outcome, row.switch_closed, row.retries) == ("success", True, 0)
    assert row.peak_contact_force < 25.0
    assert (row.total_time or math.inf) < 15.0
    assert row.max_penetration < VOID_PENETRATION


def test_a_square_peg_is_held_by_two_of_its_faces() -> None:
    with opened(assemble(load(sets=(*SQUARE, "sim.seed=3")).cell)) as cell:
        physics = cell.clock
        assert isinstance(physics, World)
        result = grasp_from_rack.run(cell.config.grasp, cell.context(3))
        assert result.outcome is Outcome.SUCCESS
        assert physics.peg is PegSituation.HELD
        load_now = physics.pad_load()
        assert load_now is not None
        assert load_now.is_flat
        assert result.theta == pytest.approx(physics.truth().theta, abs=math.radians(3.0))
