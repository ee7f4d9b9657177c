"""A plate with decoys: each hole is as exact as a hole alone, and the seam of two tiles exerts no force."""

import math

import mujoco
import numpy as np
import pytest

from cell.config.load import load
from cell.lab import contact_rig as rig
from cell.lab.section import round_depth
from cell.lab.trials import run_trial
from drivers.errors import ConfigError
from drivers.part.round import Round
from sim.contact import table as contact
from sim.contact.decoys import ROOM, cut
from sim.contact.plate import Plate
from sim.world.truth import VOID_PENETRATION
from tests.rigs import over, pushed, world_of

PEG, HOLE, DECOY = Round(0.008), Round(0.0081), Round(0.0095)
APART, FLOOR = 0.016, 0.003
"""Distance between hole and decoy along x, and depth of the decoy's floor, m."""


def plate_with_a_decoy():
    """Return a plate with a hole at its origin and a blind hole beside it; their tiles meet half-way between them."""
    halves = (-0.1 + APART / 2, 0.0, 0.1, 0.1), (0.1 - APART / 2, 0.0, 0.1, 0.1)
    own = Plate(np.zeros(3), np.eye(3), HOLE.half, 0.03, halves[0])
    decoy = Plate(np.array([APART, 0.0, 0.0]), np.eye(3), DECOY.half, FLOOR, halves[1])
    return Plate(own.position, own.rotation, own.half, own.depth, (0.0, 0.0, 0.1, 0.1), tiles=(own, decoy))


@pytest.mark.parametrize("degrees", [2, 15, 45])
@pytest.mark.parametrize(("hole", "at"), [(HOLE, 0.0), (DECOY, APART)])
def test_a_peg_goes_as_deep_into_either_hole_as_geometry_allows(degrees, hole, at):
    tilt = math.radians(degrees)
    floor = 0.03 if hole is HOLE else FLOOR
    axes = rig.attitude(tilt, 0.3)
    start = np.array([at, 0.0]) - 0.3 * rig.lowest(PEG, tilt, 0.3)[:2]
    depth, lasted = pushed(plate_with_a_decoy(), PEG, axes, start, steps=4000)
    assert depth == pytest.approx(min(round_depth(PEG, hole, tilt), floor), rel=0.01, abs=2e-5)
    assert lasted < VOID_PENETRATION


def test_nothing_is_felt_where_two_tiles_meet():
    model, data = over(plate_with_a_decoy(), PEG, rig.attitude(0.3, 0.3), 0.2)
    data.qpos[:] = APART / 2 - 0.002 - rig.lowest(PEG, 0.3, 0.3)[0], 0.03, -rig.lowest(PEG, 0.3, 0.3)[2]
    heights = []
    for step in range(400):
        data.qfrc_applied[:] = -300.0 * (data.qvel - [0.02, 0.0, 0.0])
        data.qfrc_applied[2] -= 5.0
        mujoco.mj_step(model, data)
        heights += [float(data.qpos[2])] if step > 100 else []
    assert data.qpos[0] > APART / 2 - rig.lowest(PEG, 0.3, 0.3)[0]
    assert np.ptp(heights) < 2e-6


def dragged(rubbing, speed, at=(0.0, 0.0)):
    """Return the friction, over the push, of a peg that slides along x at a speed, m/s, at a place, m."""
    plate = Plate(np.zeros(3), np.eye(3), (contact.SOLID, contact.SOLID), 0.03, rubbing=rubbing)
    model, data = over(plate, PEG, rig.attitude(0.3, 0.3), 0.2)
    data.qpos[:] = [*at, 0.0] - rig.lowest(PEG, 0.3, 0.3)
    data.qvel[0] = speed
    felt = 0.0
    for _ in range(60):
        felt = 500.0 * (speed - data.qvel[0])
        data.qfrc_applied[:] = felt, -300.0 * data.qvel[1], -5.0
        mujoco.mj_step(model, data)
    return felt / 5.0


def test_stribecks_law_holds_a_slow_peg_harder_than_a_quick_one():
    law = contact.Rubbing(1.0, 0.02, 0.0, 1.0)
    assert dragged(contact.EVEN, 0.005) == pytest.approx(dragged(contact.EVEN, 0.1), rel=0.1)
    assert dragged(law, 0.005) == pytest.approx(2.0 * dragged(law, 0.1), rel=0.1)


def test_friction_changes_from_place_to_place():
    law = contact.Rubbing(0.0, 1.0, 0.5, 0.02)
    assert dragged(law, 0.005, (0.005, 0.005)) == pytest.approx(3.0 * dragged(law, 0.005, (0.005, 0.015)), rel=0.1)


def test_tiles_cover_the_plate_once_and_each_holds_its_hole():
    rng, whole, tried = np.random.default_rng(3), (np.full(2, -0.07), np.full(2, 0.07)), 0
    for _ in range(200):
        places, reach = rng.uniform(-0.03, 0.03, (4, 2)), 0.006 + ROOM
        needed = [(place - reach, place + reach) for place in places]
        tiles = cut(needed, whole)
        if tiles is None:
            continue
        tried += 1
        assert all(np.all(low <= a) and np.all(b <= high) for (a, b), (low, high) in zip(needed, tiles, strict=True))
        assert sum(np.prod(high - low) for low, high in tiles) == pytest.approx(0.14**2)
    assert tried > 20


def test_decoys_are_drawn_from_the_seed_and_shift_nothing_else():
    plain, one, other = (world_of(*sets, "sim.seed=7") for sets in ((), *2 * (("sim.plate.decoys.number=[1,3]",),)))
    assert (plain.plate.tiles, plain.scene.held.plates) == ((), 1)
    assert np.array_equal(plain.plate.position, one.plate.position)
    places = [[tuple(tile.position) for tile in world.plate.tiles] for world in (one, other)]
    assert places[0] == places[1]
    assert 2 <= len(places[0]) <= 4


@pytest.mark.parametrize(
    ("sets", "said"),
    [
        (("sim.plate.decoys.number=[3,1]",), "sim.plate.decoys.number = .3, 1.: the least is above the largest"),
        (("sim.plate.decoys.number=[5,5]", "hole.area=[0.01,0.01]"), "no room beside the hole in hole.area"),
    ],
)
def test_impossible_decoys_are_refused_in_one_line(sets, said):
    with pytest.raises(ConfigError, match=said):
        world_of(*sets)


def test_decoys_are_passed_over_without_spending_the_one_retry():
    row = run_trial(load(sets=("world=decoys", "retries=1")).cell, 177004)
    assert row.outcome == "success"
    assert row.retries >= 2
