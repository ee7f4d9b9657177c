"""Inner loop of the simulation, compiled: the torque law, the drives, `mj_step`, and the meters after every step."""

import math
from typing import NamedTuple

import mujoco
import numpy as np
from numba import typeof

from drivers import impedance, setpoint_words
from drivers.compiled import njit
from drivers.quantities import Vector
from sim.arm import arm_senses, joint_drive
from sim.contact import latch
from sim.contact.peg_distances import PegView, is_far
from sim.hand import slip
from sim.world import metering, native

DRIVE_FORCE, DRIVE_WIDTH, DRIVE_SPEED, DRIVE_OPENING = 0, 1, 2, 3
"""Indices of the hand's drive: commanded closing force, N; commanded width, m, in use if that force is 0; then figures of
the hand: a finger's speed, m/s, and opening force, N."""
FINGER_GAIN = 2e4
"""Gain of a finger's position loop during opening, N/m."""

COARSE = 2
"""Number of ticks in a step while the held peg is far from the hole and out of reach of any metered contact."""


class Models(NamedTuple):
    """MuJoCo models for the stepping."""

    fine: int
    """Address of the mjModel of a single tick."""
    coarse: int
    """Address of a twin of that mjModel with a time step `COARSE` times longer; 0 if there is none."""
    hole: Vector
    """Mouth of the hole, see `is_far`; the twin is not used near it. A negative radius means no hole."""


class Bodies(NamedTuple):
    """State that is stepped."""

    data: int
    """Address of the mjData."""
    qpos: Vector
    """View of the positions; the arm's seven come first, as in velocities and forces."""
    qvel: Vector
    """View of the velocities."""
    qfrc: Vector
    """View of the applied generalised forces."""
    userdata: Vector
    """View of the words into which the contact function writes the penetration."""


def state_of(data: mujoco.MjData) -> Bodies:
    """Return the views of an mjData."""
    return Bodies(data._address, data.qpos, data.qvel, data.qfrc_applied, data.userdata)


class Watched(NamedTuple):
    """Bodies that the meters observe, and the condition that ends the stepping."""

    peg: PegView
    pivot: Vector
    """View of the finger centre's position, shape (3,), m, base frame."""
    plates: int
    """Number of plates; their geoms come first."""
    hinge: int
    """Index of the peg's hinge among the positions; -1 if no hand holds the peg, so that no plate force acts on the arm."""
    lost: float
    """Angle of the hinge at which the peg is lost, rad."""
    mass_centre: Vector
    """View of the peg's centre of mass, shape (3,), m, base frame."""
    load: Vector
    """View of the applied force, N, and torque, N·m, at the centre of mass, shape (6,), base frame."""
    hand: metering.HandView


class Drives(NamedTuple):
    """Commands, and figures of the device models."""

    arm: Vector
    """Figures of the arm that the cell assumes, see `drivers.impedance.figures`."""
    words: Vector
    """Setpoint in force, see `drivers.impedance`."""
    law: Vector
    """State of the torque law."""
    drive: Vector
    """The hand's drive, see the indices of this module."""
    joints: Vector
    """Drives of the joints, see `sim.arm.joint_drive`."""
    senses: Vector
    """Readings of the joints, see `sim.arm.arm_senses`."""
    grip: Vector
    """State of the pads' shear and friction on a held peg, see `sim.hand.slip`."""
    latch: Vector
    """State of the latch near the bottom, see `sim.contact.latch`."""


class Beat(NamedTuple):
    """Times of the stepping."""

    timestep: float
    """Length of a tick, s."""
    law_every: int
    """Number of ticks in a control period."""


@njit(cache=True)
def advance(
    models: Models,
    state: Bodies,
    watch: Watched,
    control: Drives,
    meters: Vector,
    beat: Beat,
    first: int,
    ticks: int,
    noise: Vector,
) -> int:  # pragma: no cover
    """Advance the physics by a time span, with the torque law once every control period.

    Args:
        models: The model, and its twin for steps in which nothing can touch the hole.
        state: Bodies of both models; updated.
        watch: Bodies that the meters observe.
        control: Commands and figures of the devices.
        meters: Meters, see `sim.world.metering`; updated.
        beat: Length of a tick and of a control period.
        first: Number of the first tick, counted from time 0.
        ticks: Number of ticks.
        noise: Standard normal numbers for the control periods, one row each, see `sim.arm.arm_senses`; one row if none are needed.

    Returns:
        Number of ticks taken: fewer if the peg was lost, none if the state is no longer finite.
    """
    qpos, qvel, qfrc, peg = state.qpos, state.qvel, state.qfrc, watch.peg
    timestep, law_every, start = beat.timestep, beat.law_every, first * beat.timestep
    lasting = metering.window(timestep)
    force, torque, nothing = np.zeros(3), np.zeros(3), np.zeros(6)
    slip.bear(control.grip, qpos, watch.hinge, control.drive[DRIVE_FORCE])
    tick = cycle = 0
    while tick < ticks:
        if (first + tick) % law_every == 0:
            now, period = start + tick * timestep, law_every * timestep
            felt = meters[metering.FORCE : metering.TORQUE + 3] if watch.hinge >= 0 else nothing
            q, dq = arm_senses.measure(control.senses, qpos[:7], qvel[:7], felt, noise[cycle])
            tau = impedance.torque(control.arm, control.words, control.law, q, dq, now, period)
            joint_drive.command(control.joints, tau, qfrc)
            cycle = min(cycle + 1, noise.shape[0] - 1)
        if watch.hinge < 0:
            _drive_fingers(state, control.drive)
        metering.clear(state.userdata)
        may_coarsen = models.coarse != 0 and (first + tick) % COARSE == 0 and tick + COARSE <= ticks
        stride = COARSE if may_coarsen and is_far(models.hole, peg.size, peg.middle, peg.axes) else 1
        joint_drive.act(control.joints, qvel, qfrc, stride > 1)
        if watch.hinge >= 0:
            slip.act(control.grip, qpos, qvel, qfrc, watch.hinge)
        # A peg that is left out of the physics has no contact force; its hole then has the radius minus infinity.
        is_latched = control.latch[latch.KIND] > 0.0 and models.hole[6] > -math.inf
        if is_latched:
            latch.act(control.latch, peg, watch.mass_centre, watch.load)
        native.step(models.fine if stride == 1 else models.coarse, state.data)
        tick += stride
        metering.net_force(state.data, watch.pivot, watch.plates, force, torque)
        if is_latched:
            latch.add_felt(control.latch, peg, watch.pivot, force, torque)
        metering.take(meters, force, torque, stride * timestep, watch.hinge, qpos)
        metering.take_jerk(meters, watch.hand, stride * timestep, control.words[setpoint_words.IS_FREE] > 0.0)
        for _ in range(stride):
            metering.judge(meters, state.userdata, lasting)
        if watch.hinge >= 0 and abs(qpos[watch.hinge]) > watch.lost:
            break
    slip.bear(control.grip, qpos, watch.hinge, control.drive[DRIVE_FORCE])
    total = 0.0
    for i in range(7):
        total += qpos[i] + qvel[i]
    return tick if math.isfinite(total) and abs(total) < 1e4 else 0


def compile_ahead() -> None:
    """Compile `advance`, or load it from the cache, for the argument types of the stepper."""
    row, rows = np.zeros(1), np.zeros((1, 1))
    models, bodies = Models(0, 0, row), Bodies(0, row, row, row, row)
    watch = Watched(PegView(row, row, rows), row, 0, 0, 0.0, row, row, metering.HandView(row, row, row, row))
    drives = Drives(row, row, row, row, row, row, row, row)
    arguments = models, bodies, watch, drives, row, Beat(0.0, 0), 0, 0, rows
    advance.compile(tuple(map(typeof, arguments)))


@njit(cache=True, inline="always")
def _drive_fingers(state: Bodies, drive: Vector) -> None:  # pragma: no cover
    """Apply the hand's drive to the two fingers, degrees of freedom 7 and 8."""
    closing, speed, strongest = drive[DRIVE_FORCE], drive[DRIVE_SPEED], drive[DRIVE_OPENING]
    for i in range(7, 9):
        if closing > 0.0:
            state.qfrc[i] = -closing * (1.0 + state.qvel[i] / speed)
        else:
            opening = FINGER_GAIN * (drive[DRIVE_WIDTH] / 2.0 - state.qpos[i])
            opening = min(max(opening, -strongest), strongest)
            state.qfrc[i] = opening - strongest / speed * state.qvel[i]
