"""The inner loop of the simulation, compiled: torque law, `mj_step`, and the meters of every step."""

import math
from typing import NamedTuple

import mujoco
import numpy as np

from drivers import impedance
from drivers.arm.model import Hand
from drivers.compiled import njit
from drivers.quantities import Vector
from sim import arm_senses, contact, joint_drive, native, slip

METER_WORDS = 128
FORCE, TORQUE, PEAK_FORCE = 0, 3, 6
"""Indices of meters: net force of the plates on the peg and its torque about the finger centre, base frame, low-passed,
N and N·m; largest force, N.
"""
SUSTAINED, RING_AT, TURN_FROM, TURN_MAX = 7, 8, 9, 10
"""Indices of meters: deepest penetration of a bore or its rim that lasted, m; place of its ring; hinge angle from which
turns are counted and the largest turn, rad.
"""
OVER_TIME, SURFACE_SUSTAINED = 11, 12
"""Indices of meters: time that the force on the held peg exceeded `OVER_FORCE`, s; deepest penetration of a surface or
a floor that lasted, m.
"""
RING, SURFACE_RING = 20, 70
"""Places of the rings that hold the newest ticks' penetrations, of bores and rims and of surfaces and floors."""

FORCE_FILTER = 0.005
"""Time constant of the low-pass on forces, s, a bandwidth of 32 Hz; single steps of a rigid contact carry no information."""
OVER_FORCE = 20.0
"""Force on the peg, N, above which time is counted."""
DRIVE_FORCE, DRIVE_WIDTH, DRIVE_SPEED, DRIVE_OPENING = 0, 1, 2, 3
"""Indices of the hand's drive: commanded closing force, N, where 0 opens to the commanded width, m; speed of a finger,
m/s, and the force that opens it, N, which are figures of the hand.
"""
FINGER_GAIN = 2e4
"""Gain of a finger's position loop when it opens, N/m."""

SUSTAINED_TIME = 0.002
"""Time for which a penetration has to last to count, s."""
COARSE = 2
"""Number of ticks in a step while the held peg is far from the hole, where nothing that is judged can be touched."""
FAR = 0.003
"""Distance of every point of the peg's end from the hole's edge beyond which the peg is far, m; in 1 ms it moves less
than a tenth of that.
"""


def new_drive(hand: Hand) -> Vector:
    """Return the words of a hand that is commanded to open as wide as it goes, shape (4,)."""
    return np.array([0.0, hand.stroke, hand.finger_speed, hand.finger_force])


class Models(NamedTuple):
    """The MuJoCo models that the physics steps with."""

    fine: int
    """Address of the mjModel of a single tick."""
    coarse: int
    """Address of its twin with a time step `COARSE` times as long, or 0."""
    hole: Vector
    """Mouth of the hole that the twin keeps away from, see `is_far`; nothing is near a hole of negative radius."""


class State(NamedTuple):
    """The mjData that is stepped."""

    data: int
    """Address of the mjData."""
    qpos: Vector
    """View of the positions; the arm's seven come first, as in velocities and forces."""
    qvel: Vector
    """View of the velocities."""
    qfrc: Vector
    """View of the applied generalised forces."""
    userdata: Vector
    """View of the words in which the contact function leaves the penetration."""


def state_of(data: mujoco.MjData) -> State:
    """Return the views of an mjData."""
    return State(data._address, data.qpos, data.qvel, data.qfrc_applied, data.userdata)


class PegView(NamedTuple):
    """The peg's size and present pose."""

    size: Vector
    """Radius and half the length, m."""
    middle: Vector
    """View of the peg's middle, shape (3,), m, base frame."""
    axes: Vector
    """View of the peg's axes, shape (3, 3), z from its end upward."""


class Watch(NamedTuple):
    """Bodies that the meters look at, and the condition that ends the stepping."""

    peg: PegView
    pivot: Vector
    """View of the finger centre's position, shape (3,), m, base frame."""
    plates: int
    """Number of plates among the first geoms."""
    hinge: int
    """Index of the peg's hinge among the positions, or -1."""
    lost: float
    """Angle of the hinge beyond which the peg is no longer held, rad."""
    is_felt: bool
    """Whether the arm feels what the plates do to the peg."""


class Control(NamedTuple):
    """The commands, and the figures that the devices' models work with."""

    arm: Vector
    """Figures of the arm as the cell believes them, see `drivers.impedance.figures`."""
    words: Vector
    """The held setpoint, see `drivers.impedance`."""
    law: Vector
    """State of the torque law."""
    drive: Vector
    """The hand's drive, see the indices of this module."""
    joints: Vector
    """Drives of the joints, see `sim.joint_drive`."""
    senses: Vector
    """Readings of the joints, see `sim.arm_senses`."""
    grip: Vector
    """State of what the pads do to a held peg, see `sim.slip`."""


class Span(NamedTuple):
    """A span of time that is stepped at once."""

    start: float
    """Time before its first tick, s."""
    timestep: float
    """Length of a tick, s."""
    ticks: int
    law_every: int
    """Number of ticks in a control period."""
    phase: int
    """Number of ticks since the last control period began."""
    noise: Vector
    """Standard normal numbers for the span's control periods, a row each, see `sim.arm_senses`; one row where none are needed."""


def new_meters() -> Vector:
    """Return meters at zero, shape (METER_WORDS,)."""
    return np.zeros(METER_WORDS)


@njit(cache=True)
def window(timestep: float) -> int:  # pragma: no cover
    """Return the number of ticks of `timestep`, s, that a penetration has to last to count."""
    return math.floor(SUSTAINED_TIME / timestep + 0.5) + 1


@njit(cache=True)
def is_far(hole: Vector, size: Vector, middle: Vector, axes: Vector) -> bool:  # pragma: no cover
    """Return whether every point of the peg's end is `FAR` from the hole's edge, sideways or above.

    Args:
        hole: Middle of the mouth, m; outward axis; radius, m: shape (7,), base frame.
        size: Radius and half the length of the peg, m.
        middle: Middle of the peg, shape (3,), m, base frame.
        axes: Axes of the peg, shape (3, 3), z from its end upward.
    """
    height, square, along = 0.0, 0.0, 0.0
    for k in range(3):
        way = middle[k] - size[1] * axes[k, 2] - hole[k]
        height += way * hole[3 + k]
        square += way * way
        along += axes[k, 2] * hole[3 + k]
    beside = math.sqrt(max(square - height * height, 0.0))
    lowest = height - size[0] * math.sqrt(max(1.0 - along * along, 0.0))
    return bool(beside > hole[6] + size[0] + FAR or lowest > FAR)


@njit(cache=True)
def pad_gap(
    pads: tuple[int, int], sizes: Vector, places: Vector, axes: Vector, peg: PegView
) -> float:  # pragma: no cover
    """Return a lower bound of the distance between the pads and the peg, m; negative where they may touch.

    Args:
        pads: Indices of the pads' geoms, which are boxes.
        sizes: Half the extents of all geoms, shape (n, 3), m.
        places: Middles of all geoms, shape (n, 3), m, base frame.
        axes: Axes of all geoms, shape (n, 9).
        peg: Size and pose of the peg.
    """
    size, middle, turned = peg.size, peg.middle, peg.axes
    least = math.inf
    for pad in pads:
        gap = -math.inf
        for k in range(3):
            away = along = 0.0
            for i in range(3):
                away += axes[pad, 3 * i + k] * (middle[i] - places[pad, i])
                along += axes[pad, 3 * i + k] * turned[i, 2]
            extent = size[1] * abs(along) + size[0] * math.sqrt(max(1.0 - along * along, 0.0))
            gap = max(gap, abs(away) - extent - sizes[pad, k])
        least = min(least, gap)
    return least


@njit(cache=True)
def advance(
    models: Models, state: State, watch: Watch, control: Control, meters: Vector, span: Span
) -> int:  # pragma: no cover
    """Advance the physics by a span of time, with the torque law once every control period.

    Args:
        models: The model, and its twin for where nothing can touch the hole.
        state: State of both models; updated.
        watch: Bodies that the meters look at.
        control: Commands and figures of the devices.
        meters: Meters, see the indices of this module; updated.
        span: The span of time.

    Returns:
        Number of ticks taken: fewer when the peg was lost, none when the state is no longer finite.
    """
    qpos, qvel, qfrc, peg = state.qpos, state.qvel, state.qfrc, watch.peg
    lasting = window(span.timestep)
    force, torque, nothing = np.zeros(3), np.zeros(3), np.zeros(6)
    tick = cycle = 0
    while tick < span.ticks:
        if (span.phase + tick) % span.law_every == 0:
            now, period = span.start + tick * span.timestep, span.law_every * span.timestep
            felt = meters[FORCE : TORQUE + 3] if watch.is_felt else nothing
            q, dq = arm_senses.measure(control.senses, qpos[:7], qvel[:7], felt, span.noise[cycle])
            tau = impedance.torque(control.arm, control.words, control.law, q, dq, now, period)
            joint_drive.command(control.joints, control.arm, qpos[:7], tau, qfrc)
            cycle = min(cycle + 1, span.noise.shape[0] - 1)
        if watch.hinge < 0:
            _drive_fingers(state, control.drive)
        _clear(state.userdata)
        may_coarsen = models.coarse != 0 and (span.phase + tick) % COARSE == 0 and tick + COARSE <= span.ticks
        stride = COARSE if may_coarsen and is_far(models.hole, peg.size, peg.middle, peg.axes) else 1
        joint_drive.act(control.joints, qvel, qfrc, stride > 1)
        if watch.hinge >= 0:
            slip.act(control.grip, qpos, qvel, qfrc, watch.hinge)
        native.step(models.fine if stride == 1 else models.coarse, state.data)
        tick += stride
        _net_force(state.data, watch.pivot, watch.plates, force, torque)
        _meter(meters, force, torque, stride * span.timestep, watch.hinge, qpos)
        for _ in range(stride):
            judge(meters, state.userdata, lasting)
        if watch.hinge >= 0 and abs(qpos[watch.hinge]) > watch.lost:
            break
    total = 0.0
    for i in range(7):
        total += qpos[i] + qvel[i]
    return tick if math.isfinite(total) and abs(total) < 1e4 else 0


@njit(cache=True)
def _drive_fingers(state: State, drive: Vector) -> None:  # pragma: no cover
    """Apply the hand's drive to the two fingers, which move at 7 and 8."""
    closing, speed, strongest = drive[DRIVE_FORCE], drive[DRIVE_SPEED], drive[DRIVE_OPENING]
    for i in range(7, 9):
        if closing > 0.0:
            state.qfrc[i] = -closing * (1.0 + state.qvel[i] / speed)
        else:
            opening = FINGER_GAIN * (drive[DRIVE_WIDTH] / 2.0 - state.qpos[i])
            opening = min(max(opening, -strongest), strongest)
            state.qfrc[i] = opening - strongest / speed * state.qvel[i]


@njit(cache=True)
def _meter(
    meters: Vector, force: Vector, torque: Vector, elapsed: float, hinge: int, qpos: Vector
) -> None:  # pragma: no cover
    """Meter the net force, N, and the torque, N·m, of a step of `elapsed`, s, and the held peg's turn."""
    blend = elapsed / (FORCE_FILTER + elapsed)
    size = 0.0
    for i in range(3):
        meters[FORCE + i] += blend * (force[i] - meters[FORCE + i])
        meters[TORQUE + i] += blend * (torque[i] - meters[TORQUE + i])
        size += meters[FORCE + i] * meters[FORCE + i]
    if hinge >= 0:
        meters[PEAK_FORCE] = max(meters[PEAK_FORCE], math.sqrt(size))
        if size > OVER_FORCE * OVER_FORCE:
            meters[OVER_TIME] += elapsed
        meters[TURN_MAX] = max(meters[TURN_MAX], abs(qpos[hinge] - meters[TURN_FROM]))


@njit(cache=True)
def _net_force(data: int, pivot: Vector, plates: int, force: Vector, torque: Vector) -> None:  # pragma: no cover
    """Write the force of the plates on the peg, N, and its torque about the pivot, N·m, base frame."""
    force[:] = 0.0
    torque[:] = 0.0
    for c in native.contacts(data):
        if c.efc_address < 0 or min(c.geom1, c.geom2) >= plates:
            continue
        # The normal points from the first geom to the second; boxes come second.
        sign = 1.0 if c.geom1 < plates else -1.0
        f, n, at = native.contact_force(data, c), c.frame, c.pos
        fx = sign * (n[0] * f[0] + n[3] * f[1] + n[6] * f[2])
        fy = sign * (n[1] * f[0] + n[4] * f[1] + n[7] * f[2])
        fz = sign * (n[2] * f[0] + n[5] * f[1] + n[8] * f[2])
        rx, ry, rz = at[0] - pivot[0], at[1] - pivot[1], at[2] - pivot[2]
        force[0] += fx
        force[1] += fy
        force[2] += fz
        torque[0] += ry * fz - rz * fy
        torque[1] += rz * fx - rx * fz
        torque[2] += rx * fy - ry * fx


@njit(cache=True)
def pad_force(data: int, left: int, right: int) -> float:  # pragma: no cover
    """Return the smaller of the forces between two geoms, the pads, and whatever they touch, N."""
    on_left = on_right = 0.0
    for c in native.contacts(data):
        if c.efc_address < 0:
            continue
        normal = native.contact_force(data, c)[0]
        if c.geom1 == left or c.geom2 == left:
            on_left += normal
        if c.geom1 == right or c.geom2 == right:
            on_right += normal
    return min(on_left, on_right)


@njit(cache=True)
def below_mouth(
    half: float, middle: Vector, axes: Vector, mouth: Vector, plate: Vector
) -> tuple[float, float]:  # pragma: no cover
    """Return the distances of the middle of a peg's end below a hole's mouth and beside the hole's axis, m.

    Args:
        half: Half the length of the peg, m.
        middle: Middle of the peg, shape (3,), m, base frame.
        axes: Axes of the peg, shape (3, 3), z from its end upward.
        mouth: Middle of the hole's mouth, shape (3,), m, base frame.
        plate: Axes of the plate, shape (3, 3), z outward.
    """
    x = middle[0] - half * axes[0, 2] - mouth[0]
    y = middle[1] - half * axes[1, 2] - mouth[1]
    z = middle[2] - half * axes[2, 2] - mouth[2]
    across = plate[0, 0] * x + plate[1, 0] * y + plate[2, 0] * z
    along = plate[0, 1] * x + plate[1, 1] * y + plate[2, 1] * z
    return -(plate[0, 2] * x + plate[1, 2] * y + plate[2, 2] * z), math.hypot(across, along)


@njit(cache=True)
def _clear(userdata: Vector) -> None:  # pragma: no cover
    """Set the penetrations that the contact functions leave back to 0."""
    userdata[contact.PENETRATION] = userdata[contact.SURFACE] = 0.0


@njit(cache=True)
def judge(meters: Vector, userdata: Vector, ticks: int) -> None:  # pragma: no cover
    """Meter one tick's penetrations; the least one of the newest `ticks` is the depth that has lasted so long."""
    at = int(meters[RING_AT])
    meters[RING + at] = userdata[contact.PENETRATION]
    meters[SURFACE_RING + at] = userdata[contact.SURFACE]
    meters[RING_AT] = float((at + 1) % ticks)
    meters[SUSTAINED] = max(meters[SUSTAINED], meters[RING : RING + ticks].min())
    meters[SURFACE_SUSTAINED] = max(meters[SURFACE_SUSTAINED], meters[SURFACE_RING : SURFACE_RING + ticks].min())


@njit(cache=True)
def judged_step(model: int, state: State, meters: Vector, ticks: int) -> None:  # pragma: no cover
    """Take one step with a model and meter its penetration; `ticks` as `judge` has it."""
    _clear(state.userdata)
    native.step(model, state.data)
    judge(meters, state.userdata, ticks)


@njit(cache=True)
def replay(
    model: int,
    data: int,
    views: tuple[Vector, Vector, Vector, Vector, Vector],
    states: Vector,
    steps: int,
) -> None:  # pragma: no cover
    """Take bare steps from each of some states, as a baseline for measurements of speed.

    Args:
        model: Address of the mjModel.
        data: Address of the mjData.
        views: Views of positions, velocities, applied forces, the solver's warm start, and joint friction.
        states: Rows of the five, one after the other.
        steps: Number of steps from each state.
    """
    qpos, qvel, qfrc, warm, friction = views
    nq, nv = qpos.shape[0], qvel.shape[0]
    for i in range(states.shape[0]):
        row = states[i]
        qpos[:] = row[:nq]
        qvel[:] = row[nq : nq + nv]
        qfrc[:] = row[nq + nv : nq + 2 * nv]
        warm[:] = row[nq + 2 * nv : nq + 3 * nv]
        friction[:] = row[nq + 3 * nv :]
        for _ in range(steps):
            native.step(model, data)
