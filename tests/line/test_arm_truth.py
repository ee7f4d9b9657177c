"""An arm that differs from the cell's model, in the whole physics: the effect of each departure from the ideal."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from drivers import impedance
from drivers.arm import dynamics
from drivers.quantities import ImpedanceSetpoint
from sim.arm.arm_truth import JointFriction, StateReading, TorquePath, WrenchReading, ideal
from sim.arm.device import SimArm
from skills.catalogue import CATALOGUE
from tests.rigs import world_of

HEAVY = 10.0
"""Factor of the believed inertia of the rotors over the shipped one at which late torques become a swing if there are no rotors."""
NEVER = 2**40
"""Ticks until the law commands."""
CURVE = JointFriction.published_curve(load().cell.arm_model().joints)


def departing(timestep=5e-4, **departure):
    """Return a world whose arm differs from the cell's model, at rest at its start."""
    world = world_of(f"sim.timestep={timestep}")
    world.begin(world.job, replace(world.draw, arm=replace(world.draw.arm, **departure)))
    return world


def test_a_rotors_inertia_adds_to_that_of_its_joint():
    rotors = np.array([0.2, 0.2, 0.2, 0.2, 0.07, 0.07, 0.07])
    tau, rates = np.array([2.0, -1.0, 1.0, 2.0, 0.5, -0.5, 0.3]), []
    for inertia in (np.zeros(7), rotors):
        world = departing(friction=JointFriction(), rotor_inertia=tuple(inertia))
        model, data = world.physics()
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        bare, period = M[:7, :7] - np.diag(inertia), world.arm.control_period
        world.beat = world.beat._replace(law_every=NEVER)
        world.wait_until(period)  # the law's one turn, in which it commands nothing
        world.command(tau)
        world.wait_until(2 * period)
        rates.append(world.dq / period)
        np.testing.assert_allclose(rates[-1], np.linalg.solve(bare + np.diag(inertia), tau), rtol=0.01, atol=0.01)
    assert (np.abs(rates[1]) < np.abs(rates[0])).all()


def test_fingers_beside_their_place_are_so_in_physics_alone():
    offset, turn = (0.0005, -0.0008, 0.001), (0.01, 0.005, -0.02)
    arm = ideal(load().cell.arm_model()).model
    longer = arm.model_copy(update={"kinematics": arm.kinematics.model_copy(update={"flange": 0.1073})})
    world = departing(model=longer, tcp_offset=offset, tcp_turn=turn)
    model, data = world.physics()
    fingers = [model.body(name).id for name in ("left", "right")]
    real, believed = world.tcp(), SimArm(world).read().tcp
    np.testing.assert_allclose(real.position, data.xpos[fingers].mean(axis=0), atol=1e-12)
    # The finger frame has the hand's axes y, z and x.
    np.testing.assert_allclose(real.rotation, data.xmat[fingers[0]].reshape(3, 3)[:, [2, 0, 1]], atol=1e-12)
    way = believed.rotation.T @ (real.position - believed.position)
    np.testing.assert_allclose(way, [offset[2] + 0.0003, offset[0], offset[1]], atol=1e-12)


@pytest.mark.parametrize(("times", "share", "swings"), [(1.0, 0.0, False), (HEAVY, 0.0, True), (HEAVY, 0.4, False)])
def test_late_torques_swing_a_halted_arm_only_if_inertia_is_overestimated(times, share, swings):
    believed = times * np.array(load().cell.arm_model().joints.rotor_inertia)
    world = departing(friction=JointFriction(), rotor_inertia=tuple(share * believed), path=TorquePath(2, 100.0))
    first = impedance.MASSES + dynamics.ROTORS
    world.control.arm[first : first + 7] = believed
    SimArm(world).halt()
    _, data = world.physics()
    data.qvel[:7] = 0.02
    world.wait_until(1.0)
    swing = []
    for k in range(100):
        world.wait_until(1.0 + 0.002 * k)
        swing.append(np.abs(world.dq).max())
    assert (max(swing) > 0.5) == swings


def motion(timestep):
    """Return places of the tip of a softly held departing arm under residual gravity at one time step, shape (30, 3), m."""
    world = departing(
        timestep,
        friction=CURVE,
        rotor_inertia=(0.05,) * 7,
        path=TorquePath(1, 100.0),
        gravity=(0.0, 2.0, 0.0, 2.0, 0.0, 1.0, 0.0),
    )
    arm, stiffness = SimArm(world), np.array([400.0, 400.0, 400.0, 60.0, 60.0, 60.0])
    tcp, places = arm.read().tcp, []
    arm.follow(ImpedanceSetpoint(1, tcp.position, -tcp.rotation[:, 0], stiffness, np.ones(6), math.inf))
    for k in range(1, 31):
        world.wait_until(0.02 * k)
        places.append(world.tcp().position)
    return np.array(places)


def test_the_motion_is_that_of_a_quarter_of_the_step():
    coarse, fine = motion(5e-4), motion(1.25e-4)
    assert np.linalg.norm(fine[-1] - fine[0]) > 2e-3
    assert np.linalg.norm(coarse - fine, axis=1).max() < 0.02 * np.linalg.norm(fine[-1] - fine[0])


DEPARTURES = {
    "smooth friction, rotors and late torques": {
        "friction": CURVE,
        "rotor_inertia": (0.1,) * 7,
        "path": TorquePath(1, 100.0),
    },
    "everything a little": {
        "friction": JointFriction(dry=(0.3, 0.5, 0.4, 0.7, 0.4, 0.2, 0.3), viscous=(0.05,) * 7),
        "rotor_inertia": (0.15, 0.15, 0.15, 0.15, 0.06, 0.06, 0.06),
        "path": TorquePath(2, 150.0),
        "reading": StateReading(zero=(3e-4,) * 7, noise=1e-5, rate_noise=(1e-3,) * 7),
        "wrench": WrenchReading(force=(0.5, -0.5, 1.0), force_noise=0.5, cutoff=50.0),
        "gravity": (0.02, 0.2, 0.1, 0.2, 0.05, 0.05, 0.01),
        "tcp_offset": (2e-4, -2e-4, 1e-4),
    },
}


@pytest.mark.parametrize(
    ("name", "timestep"), [*((name, 5e-4) for name in DEPARTURES), ("everything a little", 2.5e-4)]
)
def test_the_peg_stays_out_of_the_wall_at_both_steps(name, timestep):
    sets = ["sim.pace=max", "reality.scale=0.0", "sim.seed=7", f"sim.timestep={timestep}", "hole.area=[0.01, 0.01]"]
    config = load(sets=sets).cell
    with opened(assemble(config)) as cell:
        world = cell.clock
        world.begin(world.job, replace(world.draw, arm=replace(world.draw.arm, **DEPARTURES[name])))
        records = CATALOGUE["insert_peg"].run(config.skill_set(), cell.context(7))
        truth = world.truth()
    assert "tactile_insert" in [record.name for record in records]
    assert not truth.is_void
    assert truth.max_penetration < 2e-6
