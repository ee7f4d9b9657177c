"""The inner loop of the stand-in, compiled: torque law, `mj_step`, and what is metered at every step."""

import math

import numpy as np
from numba import carray

from drivers import impedance
from drivers.compiled import njit
from drivers.quantities import Vector
from sim import contact, native

METER_WORDS = 64
FORCE, TORQUE, PEAK_FORCE = 0, 3, 6
"""Net force of the plates on the peg and its torque about the finger centre, base frame, low-passed; largest force, N."""
SUSTAINED, RING_AT, TURN_FROM, TURN_MAX = 7, 8, 9, 10
"""Deepest penetration that lasted, m; its ring; hinge angle that turns are counted from and the largest turn, rad."""
RING = 20

FORCE_FILTER = 0.005
"""Time constant of the low-pass on forces, s: single steps of a rigid contact say little."""
DRIVE_FORCE, DRIVE_WIDTH = 0, 1
"""Of the hand's drive: closing force commanded, N, where 0 opens to the width commanded, m."""
FINGER_SPEED = 0.05
"""Of each finger, m/s; data sheet of the hand."""
FINGER_FORCE = 30.0
"""That opens the fingers, N."""
FINGER_GAIN = 2e4
"""Of a finger's position loop when it opens, N/m."""

SUSTAINED_TIME = 0.002
"""A penetration counts when it lasts longer, s."""


def new_meters() -> Vector:
    """Return meters at zero, shape (METER_WORDS,)."""
    return np.zeros(METER_WORDS)


@njit(cache=True)
def advance(
    model: int,
    data: int,
    qpos: Vector,
    qvel: Vector,
    qfrc: Vector,
    pivot: Vector,
    userdata: Vector,
    words: Vector,
    state: Vector,
    meters: Vector,
    drive: Vector,
    hinge: int,
    plates: int,
    start: float,
    timestep: float,
    steps: int,
    law_every: int,
    phase: int,
) -> int:  # pragma: no cover
    """Advance the physics by `steps`, with the torque law every `law_every` of them.

    Args:
        model: Address of the mjModel.
        data: Address of the mjData.
        qpos: View of its positions; likewise `qvel`, `qfrc` (applied forces) and `userdata`.
        qvel: Velocities; the arm's seven come first, as in `qpos`.
        qfrc: Applied generalised forces.
        pivot: View of the finger centre's position, m, base frame.
        userdata: Where the contact function leaves the penetration.
        words: The held setpoint, see `drivers.impedance`.
        state: State of the law.
        meters: What is metered, see the indices of this module; updated.
        drive: Command of the hand's drive.
        hinge: Index of the peg's hinge in `qpos`, or -1.
        plates: How many of the first geoms are plates.
        start: Time before the first step, s.
        timestep: s.
        steps: How many to take.
        law_every: Steps in a control period.
        phase: Steps since the last control period began.

    Returns:
        1 when the state is no longer finite, else 0.
    """
    blend = timestep / (FORCE_FILTER + timestep)
    window = math.floor(SUSTAINED_TIME / timestep + 0.5) + 1
    force, torque = np.zeros(3), np.zeros(3)
    for step in range(steps):
        if (phase + step) % law_every == 0:
            tau = impedance.torque(words, state, qpos[:7], qvel[:7], start + step * timestep, law_every * timestep)
            for i in range(7):
                qfrc[i] = tau[i]
        if hinge < 0:
            closing = drive[DRIVE_FORCE]
            for i in range(7, 9):
                if closing > 0.0:
                    qfrc[i] = -closing * (1.0 + qvel[i] / FINGER_SPEED)
                else:
                    opening = min(max(FINGER_GAIN * (drive[DRIVE_WIDTH] / 2.0 - qpos[i]), -FINGER_FORCE), FINGER_FORCE)
                    qfrc[i] = opening - FINGER_FORCE / FINGER_SPEED * qvel[i]
        userdata[contact.PENETRATION] = 0.0
        native.step(model, data)

        force[:] = 0.0
        torque[:] = 0.0
        count = carray(native.pointer(data + native.DATA_NCON), (1,), np.int32)[0]
        if count > 0:
            first = native.load(data + native.DATA_CONTACT)
            efc = native.load(data + native.DATA_EFC_FORCE)
            for k in range(count):
                address = first + k * native.CONTACT_BYTES
                row = carray(native.pointer(address + native.CONTACT_EFC_ADDRESS), (1,), np.int32)[0]
                geom = carray(native.pointer(address + native.CONTACT_GEOM1), (1,), np.int32)[0]
                if row < 0 or geom >= plates:
                    continue
                f = carray(native.pointer(efc + 8 * row), (3,), np.float64)
                c = carray(native.pointer(address), (13,), np.float64)
                fx = c[4] * f[0] + c[7] * f[1] + c[10] * f[2]
                fy = c[5] * f[0] + c[8] * f[1] + c[11] * f[2]
                fz = c[6] * f[0] + c[9] * f[1] + c[12] * f[2]
                rx, ry, rz = c[1] - pivot[0], c[2] - pivot[1], c[3] - pivot[2]
                force[0] += fx
                force[1] += fy
                force[2] += fz
                torque[0] += ry * fz - rz * fy
                torque[1] += rz * fx - rx * fz
                torque[2] += rx * fy - ry * fx
        size = 0.0
        for i in range(3):
            meters[FORCE + i] += blend * (force[i] - meters[FORCE + i])
            meters[TORQUE + i] += blend * (torque[i] - meters[TORQUE + i])
            size += meters[FORCE + i] * meters[FORCE + i]
        if hinge >= 0:
            meters[PEAK_FORCE] = max(meters[PEAK_FORCE], math.sqrt(size))

        at = int(meters[RING_AT])
        meters[RING + at] = userdata[contact.PENETRATION]
        meters[RING_AT] = float((at + 1) % window)
        lasting = meters[RING]
        for i in range(1, window):
            lasting = min(lasting, meters[RING + i])
        meters[SUSTAINED] = max(meters[SUSTAINED], lasting)
        if hinge >= 0:
            meters[TURN_MAX] = max(meters[TURN_MAX], abs(qpos[hinge] - meters[TURN_FROM]))
    total = 0.0
    for i in range(7):
        total += qpos[i] + qvel[i]
    return 0 if math.isfinite(total) and abs(total) < 1e4 else 1


@njit(cache=True)
def bare(model: int, data: int, steps: int) -> None:  # pragma: no cover
    """Take bare steps, with nothing around them: what a measurement of speed is held against."""
    for _ in range(steps):
        native.step(model, data)
