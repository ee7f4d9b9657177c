"""Outlines of plates: nothing is beyond them, and plates of different heights stand side by side."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from cell.lab import contact_rig as rig
from drivers.part.round import Round
from sim.contact.plate import outline_of
from sim.contact.table import ENDLESS, PLATE
from tests.rigs import world_of

FIELDS = PLATE.names
assert FIELDS is not None
MIDDLE, HALF = FIELDS.index("middle_x"), FIELDS.index("half_x")


def height_at(place: tuple[float, float]) -> float:
    """Return how deep a peg sinks in 0.1 s that is pushed down at a place, m, on a plate of 60 x 40 mm about (10, 0) mm."""
    model = rig.tilted_peg(Round(0.008), Round(0.0081), 0.3, 0.0, 0.2, 5e-4)
    model.geom("plate").user[MIDDLE : MIDDLE + 4] = 0.01, 0.0, 0.03, 0.02
    data = mujoco.MjData(model)
    data.qpos[:] = [*place, 0.004 * math.sin(0.3) + 1e-4]
    for _ in range(200):
        data.qfrc_applied[2] = -5.0
        mujoco.mj_step(model, data)
    return -float(data.qpos[2])


@pytest.mark.parametrize(
    ("place", "is_on_it"),
    [
        ((0.03, 0.0), True),
        ((0.045, 0.0), False),
        ((-0.015, 0.0), True),
        ((-0.03, 0.0), False),
        ((0.015, 0.015), True),
        ((0.015, 0.025), False),
    ],
)
def test_a_peg_rests_on_a_plate_and_falls_beside_it(place: tuple[float, float], is_on_it: bool) -> None:
    assert (height_at(place) < 0.0) == is_on_it


def test_a_peg_in_the_plate_from_the_side_is_not_thrown_out() -> None:
    """Its end goes through the plate, which has no side, into the wall of the hole, and would be pushed into the bore at metres a second."""
    model = rig.tilted_peg(Round(0.008), Round(0.0081), 0.1, 0.0, 0.2, 5e-4)
    data = mujoco.MjData(model)
    fastest = 0.0
    for beside in np.arange(0.012, 0.0, -2e-5):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = [beside, 0.0, -0.01]
        mujoco.mj_step(model, data)
        fastest = max(fastest, float(np.abs(data.qvel).max()))
    assert fastest < 2.5


def test_outline_covers_the_rectangle_also_for_a_plate_that_is_turned() -> None:
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    x, y, half_x, half_y = outline_of(np.array([0.5, 0.1, 0.0]), turned, (0.4, 0.0), (0.7, 0.1))
    assert (x, y, half_x, half_y) == pytest.approx((-0.05, -0.05, 0.05, 0.15))
    assert outline_of(np.zeros(3), np.eye(3), (-0.1, -0.1), (0.1, 0.1)) == pytest.approx(ENDLESS)


def test_a_rack_beside_the_plate_at_another_height_disturbs_nothing() -> None:
    """The rack stands 0.05 m higher than the plate, within 0.1 m of the hole: its surface is no ceiling over the plate."""
    world = world_of("rack.first=[0.5, -0.09, 0.15]", "rack.slots=1")
    peg = world.peg_pose()
    under = np.array([peg.position[0], -0.05, 0.12 + world.scene.size.half])
    world.enter_free(0.08, replace(peg, position=under))
    world.wait_until(0.01)
    assert world.physics()[1].ncon == 0
    assert abs(float(world.end()[2]) - 0.12) < 1e-3
