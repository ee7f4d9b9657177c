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


def test_square_pegs_are_seated_quickly_and_gently_in_holes_that_are_turned() -> None:
    config = load(sets=(*SQUARE, "hole.area=[0.01, 0.01]")).cell
    rows = [run_trial(config, seed) for seed in (103, 104)]
    assert [row.outcome for row in rows] == ["success"] * 2
    assert all(row.switch_closed for row in rows)
    assert max(row.peak_contact_force for row in rows) < 25.0
    assert max(row.total_time or math.inf for row in rows) < 15.0
    assert max(row.max_penetration for row in rows) < VOID_PENETRATION


def test_walls_are_felt_too_where_the_hole_is_known_not_to_be_turned() -> None:
    row = run_trial(load(sets=(*SQUARE, "hole.area=[0.01, 0.01]", "hole.yaw=0.0")).cell, 246)
    assert (row.outcome, row.retries) == ("success", 0)


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
