"""A finite grip: the peg holds just below each bound, slips just above it, and the kind of slip is reported."""

import math

import numpy as np
import pytest

from drivers.frames import compose, peg_in_finger
from drivers.quantities import Pose, Vector
from sim.arm.device import SimArm
from sim.hand import slip
from sim.world import engine
from sim.world.physics import World
from sim.world.situation import PegSituation
from sim.world.stepper import HINGE
from tests.rigs import world_of

GRIP = 30.0
"""N."""
ENOUGH = 2e-4
"""Slip at which a load is taken away, m."""


def holding(theta: float = 0.0, beside: float = 0.0) -> World:
    """Return a world whose hand holds a peg of no weight at this in-hand angle, rad, so far beside the finger centre, m."""
    world = world_of("grip.friction=0.4", "peg.mass=1e-3")
    SimArm(world).halt()
    world.control.drive[engine.DRIVE_FORCE] = GRIP
    held = compose(world.tcp(), peg_in_finger(theta, world.job.peg.length))
    lateral = world.tcp().rotation @ np.array([-math.sin(theta), math.cos(theta), 0.0])
    middle = held.position + world.scene.size.half * held.rotation[:, 2] + beside * lateral
    world.enter_free(world.job.peg.part.thickness, Pose(middle, held.rotation))
    world.enter_held()
    world.wait_until(0.2)
    return world


def slipped(world: World, load: Vector, seconds: float = 0.5, far: bool = False) -> float:
    """Load the peg in rotation, along and beside, by shares of each bound, and return the slip.

    Args:
        world: With a peg in the hand.
        load: Shares, shape (3,).
        seconds: Time over which the load grows; it then stays for as long.
        far: Whether the load stays although the peg has slipped a little.

    Returns:
        Change of the place where the peg sticks, in units of what the shear gives at the bound.
    """
    words = world.control.grip
    force, torque = words[slip.FORCE], words[slip.TORQUE]
    before = words[slip.STUCK : slip.STUCK + 3].copy()
    data = world.physics()[1]
    force_z, force_y = load[1] * force, load[2] * force
    # About the finger centre, of a force through the middle of the contact.
    moment = load[0] * torque + words[slip.BESIDE] * force_z - words[slip.ALONG] * force_y
    goal = np.array([moment, force_z, force_y])
    began, given = world.now(), np.zeros(3)
    while world.is_held and world.now() - began < 2.0 * seconds and (far or words[slip.SLIP] < ENOUGH):
        wanted = goal * min((world.now() - began) / seconds, 1.0)
        data.qfrc_applied[HINGE : HINGE + 3] += wanted - given
        given = wanted
        world.wait_until(world.now() + 0.01)
    if not world.is_held:
        return math.inf
    data.qfrc_applied[HINGE : HINGE + 3] -= given
    world.wait_until(world.now() + 0.3)
    moved = words[slip.STUCK : slip.STUCK + 3] - before
    elastic = np.array([torque / words[slip.TURNING], *[force / words[slip.STIFFNESS]] * 2])
    return float(np.abs(moved / elastic).max())


LOADS = {
    "turn": (1.0, 0.0, 0.0),
    "along": (0.0, -1.0, 0.0),
    "across": (0.0, 0.0, 1.0),
    "slanting": (0.0, math.sqrt(0.5), math.sqrt(0.5)),
    "turn and force": (0.6, 0.0, 0.8),
    "all": (-0.6, 0.64, -0.48),
}


@pytest.mark.parametrize("name", LOADS)
@pytest.mark.parametrize("place", [(0.0, 0.0), (0.3, 1.5e-3)])
def test_the_grip_holds_below_the_limit_surface_and_slips_above(name: str, place: tuple[float, float]) -> None:
    world = holding(*place)
    assert slipped(world, 0.98 * np.array(LOADS[name])) < 1e-3
    assert world.truth().grip_slip < 1e-6
    assert slipped(world, 1.03 * np.array(LOADS[name])) > 0.1


def test_forces_are_bounded_by_twice_friction_times_the_grip() -> None:
    """Two pads at 0.4 under 30 N bear 24 N; of a moment a quarter of the 35.5 mm that lie between them times as much."""
    words = holding().control.grip
    assert words[slip.FORCE] == pytest.approx(2 * 0.4 * GRIP)
    assert words[slip.CONTACT] == pytest.approx(0.0355, abs=2e-4)
    assert words[slip.TORQUE] == pytest.approx(words[slip.FORCE] * words[slip.CONTACT] / 4, rel=1e-6)


def test_a_peg_is_held_where_it_was_grasped() -> None:
    world = holding(0.3, 1.5e-3)
    load = world.pad_load()
    assert load is not None
    assert load.offset == pytest.approx(1.5e-3, abs=2e-6)
    assert load.theta == pytest.approx(0.3, abs=1e-4)


def test_the_slip_of_the_peg_is_measured_and_kept() -> None:
    world = holding()
    slipped(world, np.array([0.0, 0.0, 1.03]))
    told = world.truth().grip_slip
    load = world.pad_load()
    assert load is not None
    assert told == pytest.approx(abs(load.offset), rel=0.02)
    assert told > 1e-4


def test_a_peg_that_slips_out_of_the_pads_is_lost() -> None:
    world = holding()
    slipped(world, np.array([0.0, -1.5, 0.0]), far=True)
    assert world.peg is PegSituation.FREE


def test_a_peg_under_half_the_bound_does_not_creep() -> None:
    world = holding()
    assert slipped(world, np.array([0.3, -0.3, 0.3]), 30.0) == 0.0


def test_the_shear_of_the_pads_gives_way_as_its_stiffness_says() -> None:
    world = holding()
    data = world.physics()[1]
    data.qfrc_applied[HINGE + 1] += 10.0
    before = float(data.qpos[HINGE + 1])
    world.wait_until(world.now() + 0.5)
    assert float(data.qpos[HINGE + 1]) - before == pytest.approx(10.0 / 5e4, rel=1e-3)
