"""Gates of the stand-in as a whole: grip, pivot, rest, and the effect of the time step."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from cell.devices.assembly import Cell, assemble
from cell.peg.ending import ending_of
from drivers import impedance
from drivers.arm.inertia import tip_inertia
from drivers.frames import rotation_about
from drivers.quantities import Pose
from sim.world import metering, truth
from sim.world.physics import World
from sim.world.situation import PegSituation
from skills import grasp_from_rack
from skills.catalogue import CATALOGUE
from skills.contract import Outcome

FAST = ('sim.pace="max"', "reality.scale=0.0")


def cell_of(seed: int, *sets: str) -> tuple[Cell, World]:
    """Return an opened simulated cell and its world."""
    cell = assemble(load(sets=(*FAST, f"sim.seed={seed}", *sets)).cell)
    for _, device in cell.devices():
        device.open()
    assert isinstance(cell.clock, World)
    return cell, cell.clock


def holding(seed: int, *sets: str) -> tuple[Cell, World]:
    """Return a cell whose hand has taken the peg from the rack."""
    cell, physics = cell_of(seed, *sets)
    result = grasp_from_rack.run(cell.config.grasp, cell.context(seed))
    assert result.outcome is Outcome.SUCCESS
    assert physics.peg is PegSituation.HELD
    cell.arm.halt()
    physics.wait_until(physics.now() + 1.0)
    return cell, physics


@pytest.mark.parametrize("shape", ["round", "square"])
def test_a_peg_released_in_the_hole_rests_on_the_switch(shape: str) -> None:
    """`test_gates_contact.py` has the rest itself: away from the hand, the world leaves a peg at rest out of its steps."""
    _, physics = cell_of(4, f"peg.shape={shape}")
    plate = physics.plate
    aslant = rotation_about(plate.rotation[:, 0], math.radians(0.1)) @ plate.rotation
    half = physics.scene.size.half
    physics.enter_free(width=0.08, peg=Pose(plate.position + plate.rotation[:, 2] * (half - 0.019), aslant))
    physics.wait_until(physics.now() + 2.0)
    tip = np.array(physics.truth().tip)
    assert physics.truth().switch_closed
    physics.wait_until(physics.now() + 2.0)
    assert np.linalg.norm(np.array(physics.truth().tip) - tip) < 2e-6
    assert float(np.abs(physics.physics()[1].qvel[9:]).max()) < 1e-4
    assert physics.meters[metering.SUSTAINED] < truth.VOID_PENETRATION


def leaning(*end: float) -> World:
    """Return a world two seconds after the hand has opened round a leaning peg; the place of its end is from the hole, m."""
    _, physics = cell_of(5)
    axes = rotation_about(np.array([1.0, 0.0, 0.0]), 0.6)
    physics.enter_free(0.06, Pose(physics.plate.position + end + physics.scene.size.half * axes[:, 2], axes))
    physics.wait_until(physics.now() + 2.0)
    return physics


@pytest.mark.parametrize("beside", [0.0, 0.003, 0.05])
def test_a_released_peg_that_topples_lies_on_the_plate(beside: float) -> None:
    physics = leaning(0.0, beside, 0.003)
    lying = physics.peg_pose()
    assert abs(lying.rotation[2, 2]) < 0.05
    assert lying.position[2] - physics.plate.position[2] == pytest.approx(physics.scene.size.reach, abs=3e-4)


@pytest.mark.parametrize("depth", [0.003, 0.009])
def test_a_peg_that_is_squeezed_out_of_the_plate_lands(depth: float) -> None:
    """It starts with its end in the plate's solid, as after a jam, and is flung out faster than steps can follow."""
    assert np.abs(leaning(0.002, 0.003, -depth).physics()[1].qvel[9:]).max() < 100.0


@pytest.mark.parametrize(("ground", "lean"), [("plate", 0.05), ("rack", 0.1), ("table", 0.05)])
def test_a_lost_peg_comes_to_rest_on_what_is_below(ground: str, lean: float) -> None:
    """On the rack, it leans on the mouth of a slot."""
    _, physics = cell_of(5)
    rack, plate = physics.scene.rack.position, physics.plate.position
    below = {"plate": plate + 0.05 * np.array([1.0, 1.0, 0.0]), "rack": rack, "table": rack + np.array([0.2, 0.0, 0.0])}
    middle = below[ground] + np.array([0.0, 0.0, 0.1])
    physics.enter_free(0.008, Pose(middle, np.eye(3)))
    physics.fall()
    physics.wait_until(physics.now() + 1.0)
    lying = physics.peg_pose()
    assert abs(lying.rotation[2, 2]) < lean
    np.testing.assert_allclose(lying.position[:2], middle[:2], atol=0.02)
    height = 0.0 if ground == "table" else below[ground][2]
    assert lying.position[2] == pytest.approx(height + physics.scene.size.reach, abs=1e-3)
    assert float(np.abs(physics.physics()[1].qvel[9:]).max()) < 1e-2


def inserted(seed: int, timestep: float) -> tuple[str, float]:
    """Run a whole insertion with the hole within 10 x 10 mm; return how it ends and is judged, and its peak force, N."""
    cell, physics = cell_of(seed, f"sim.timestep={timestep}", "hole.area=[0.01, 0.01]")
    stages = CATALOGUE["insert_peg"].run(cell.config.skill_set(), cell.context(seed))
    ending, truth = ending_of(stages, None, ""), physics.truth()
    return f"{ending.stage} {ending.outcome} void={truth.is_void}", truth.peak_contact_force


def test_half_the_time_step_changes_less_than_another_seed_does() -> None:
    """Force is reported within 32 Hz; the force of a rigid contact in one step doubles as the step is halved."""
    coarse, fine = ([inserted(seed, timestep) for seed in range(1, 4)] for timestep in (0.0005, 0.00025))
    assert [ending for ending, _ in coarse] == [ending for ending, _ in fine]
    forces, halved = (np.array([force for _, force in each]) for each in (coarse, fine))
    assert np.median(np.abs(halved - forces)) < 0.5 * forces.std()
    assert abs(float(halved.mean() - forces.mean())) < forces.std()


@pytest.mark.parametrize("seed", [122, 270, 279])
def test_pads_press_a_thin_peg_and_do_not_throw_it(seed: int) -> None:
    """Three of the five seeds in 300 at which MuJoCo took the peg to be through the pad."""
    _, physics = holding(seed, "peg.diameter=0.004", "hole.diameter=0.0041")
    assert physics.meters[metering.SUSTAINED] < 1e-6


def test_a_peg_out_of_reach_costs_nothing_and_stays() -> None:
    _, physics = cell_of(4)
    _, watched = cell_of(4, "sim.model.long_steps=false")
    for each in (physics, watched):
        each.wait_until(0.5)
    assert physics.physics()[1].ncon == 0 < watched.physics()[1].ncon
    np.testing.assert_allclose(physics.peg_pose().position, watched.peg_pose().position, atol=1e-7)


def test_a_peg_at_rest_is_back_before_the_pads_reach_it() -> None:
    cell, physics = cell_of(5)
    seen: list[tuple[bool, float]] = []
    ctx = cell.context(5)
    ctx.callbacks = replace(
        ctx.callbacks, record=lambda scan, setpoint: seen.append((physics.physics()[1].ncon > 0, physics.pad_force()))
    )
    assert grasp_from_rack.run(cell.config.grasp, ctx).outcome is Outcome.SUCCESS
    asleep = [awake for awake, _ in seen].index(False)
    woken = [awake for awake, _ in seen].index(True, asleep)
    touched = next(k for k, (_, force) in enumerate(seen) if force > 0.0)
    assert asleep < woken < touched - 3


@pytest.mark.parametrize("begin", [cell_of, holding], ids=["empty hand", "peg in the hand"])
def test_the_jerk_of_a_struck_arm_is_that_of_its_finger_centre(begin) -> None:
    _, physics = begin(1)
    position, _, axes, origins = impedance.forward(impedance.figures(physics.arm), physics.q)
    # The meters begin anew where the grasp has ended.
    physics.meters[[metering.JERK_FREE, metering.JERK_CONTACT]] = 0.0
    velocity = 0.2 * np.cross(axes[0], position - origins[0]) + 0.3 * np.cross(axes[3], position - origins[3])
    physics.physics()[1].qvel[[0, 3]] += (0.2, 0.3)
    physics.wait_until(physics.now() + 0.2)
    rate = 2.0 * math.pi * metering.JERK_BANDWIDTH
    found = physics.truth()
    assert max(found.jerk_free, found.jerk_contact) == pytest.approx(
        rate**2 * float(np.linalg.norm(velocity)), rel=0.08
    )


def test_the_true_inertia_of_the_hand_is_that_of_the_arm() -> None:
    _, physics = holding(1)
    tcp = physics.tcp()
    found = physics.inertia(tcp.position + 0.05 * tcp.rotation[:, 0])
    joints = physics.arm.joints.model_copy(update={"rotor_inertia": physics.draw.arm.rotor_inertia})
    expected = tip_inertia(physics.arm.model_copy(update={"joints": joints}), physics.q, 0.05)
    np.testing.assert_allclose(found, expected, atol=0.02 * np.abs(expected).max())
