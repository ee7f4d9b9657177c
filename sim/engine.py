"""The inner loop of the stand-in, compiled: torque law, `mj_step`, and what is metered at every step."""

import math

import numpy as np

from drivers import impedance
from drivers.arm.model import Hand
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
DRIVE_FORCE, DRIVE_WIDTH, DRIVE_SPEED, DRIVE_OPENING = 0, 1, 2, 3
"""The hand's drive: closing force commanded, N, where 0 opens to the width commanded, m; speed of a finger, m/s, and the
force that opens it, N, which are figures of the hand."""
FINGER_GAIN = 2e4
"""Of a finger's position loop when it opens, N/m."""

SUSTAINED_TIME = 0.002
"""A penetration counts when it lasts longer, s."""
COARSE = 2
"""Ticks in a step while the held peg is far from the hole: nothing that is judged can be touched there."""
FAR = 0.003
"""How far from the hole's edge every point of the peg's end is then, m; in 1 ms it moves less than a tenth of that."""


def new_meters() -> Vector:
    """Return meters at zero, shape (METER_WORDS,)."""
    return np.zeros(METER_WORDS)


def window(timestep: float) -> int:
    """Return over how many ticks of `timestep`, s, a penetration must last to count."""
    return math.floor(SUSTAINED_TIME / timestep + 0.5) + 1


def new_drive(hand: Hand) -> Vector:
    """Return the words of a hand that is commanded to open as wide as it goes, shape (4,)."""
    return np.array([0.0, hand.stroke, hand.finger_speed, hand.finger_force])


@njit(cache=True)
def is_far(hole: Vector, size: Vector, middle: Vector, axes: Vector) -> bool:  # pragma: no cover
    """Whether every point of the peg's end is `FAR` from the hole's edge, sideways or above.

    Args:
        hole: Middle of the mouth, m; outward axis; radius, m: shape (7,), base frame.
        size: Radius and half the length of the peg, m.
        middle: Of the peg, shape (3,), m, base frame.
        axes: Of the peg, shape (3, 3), z from its end upward.
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
    pads: tuple[int, int], sizes: Vector, places: Vector, axes: Vector, peg: tuple[Vector, Vector, Vector]
) -> float:  # pragma: no cover
    """Return a distance, m, that no pad is nearer to the peg than; negative where one may touch it.

    Args:
        pads: The two geoms, boxes.
        sizes: Half the extents of all geoms, shape (n, 3), m; likewise `places` and `axes`, shape (n, 9).
        places: Their middles, m, base frame.
        axes: Their axes.
        peg: Size, place and axes of the peg, see `is_far`.
    """
    size, middle, turned = peg
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
    models: tuple[int, int],
    data: int,
    qpos: Vector,
    qvel: Vector,
    qfrc: Vector,
    pivot: Vector,
    peg: tuple[Vector, Vector, Vector],
    hole: Vector,
    userdata: Vector,
    arm: Vector,
    words: Vector,
    state: Vector,
    meters: Vector,
    drive: Vector,
    hinge: int,
    lost: float,
    plates: int,
    start: float,
    timestep: float,
    ticks: int,
    law_every: int,
    phase: int,
) -> int:  # pragma: no cover
    """Advance the physics by `ticks`, with the torque law every `law_every` of them.

    Args:
        models: Addresses of the mjModel and of its twin with a time step `COARSE` times as long, or 0.
        data: Address of the mjData of both.
        qpos: View of its positions; likewise `qvel`, `qfrc` (applied forces) and `userdata`.
        qvel: Velocities; the arm's seven come first, as in `qpos`.
        qfrc: Applied generalised forces.
        pivot: View of the finger centre's position, m, base frame.
        peg: Size, and views of place and axes of the peg, see `is_far`.
        hole: See `is_far`; with a negative radius nothing is ever near it.
        userdata: Where the contact function leaves the penetration.
        arm: Its figures, see `drivers.impedance.figures`.
        words: The held setpoint, see `drivers.impedance`.
        state: State of the law.
        meters: What is metered, see the indices of this module; updated.
        drive: The hand's drive, see the indices of this module.
        hinge: Index of the peg's hinge in `qpos`, or -1.
        lost: Angle of the hinge beyond which the peg is no longer held, rad.
        plates: How many of the first geoms are plates.
        start: Time before the first tick, s.
        timestep: Of one tick, s.
        ticks: How many to take.
        law_every: Ticks in a control period.
        phase: Ticks since the last control period began.

    Returns:
        How many were taken: fewer when the peg got lost, none when the state is no longer finite.
    """
    lasting = math.floor(SUSTAINED_TIME / timestep + 0.5) + 1
    force, torque = np.zeros(3), np.zeros(3)
    tick = 0
    while tick < ticks:
        if (phase + tick) % law_every == 0:
            tau = impedance.torque(arm, words, state, qpos[:7], qvel[:7], start + tick * timestep, law_every * timestep)
            for i in range(7):
                qfrc[i] = tau[i]
        if hinge < 0:
            closing, speed, strongest = drive[DRIVE_FORCE], drive[DRIVE_SPEED], drive[DRIVE_OPENING]
            for i in range(7, 9):
                if closing > 0.0:
                    qfrc[i] = -closing * (1.0 + qvel[i] / speed)
                else:
                    opening = min(max(FINGER_GAIN * (drive[DRIVE_WIDTH] / 2.0 - qpos[i]), -strongest), strongest)
                    qfrc[i] = opening - strongest / speed * qvel[i]
        userdata[contact.PENETRATION] = 0.0
        may_coarsen = models[1] != 0 and (phase + tick) % COARSE == 0 and tick + COARSE <= ticks
        stride = COARSE if may_coarsen and is_far(hole, peg[0], peg[1], peg[2]) else 1
        native.step(models[0] if stride == 1 else models[1], data)
        tick += stride

        _net_force(data, pivot, plates, force, torque)
        blend = stride * timestep / (FORCE_FILTER + stride * timestep)
        size = 0.0
        for i in range(3):
            meters[FORCE + i] += blend * (force[i] - meters[FORCE + i])
            meters[TORQUE + i] += blend * (torque[i] - meters[TORQUE + i])
            size += meters[FORCE + i] * meters[FORCE + i]
        if hinge >= 0:
            meters[PEAK_FORCE] = max(meters[PEAK_FORCE], math.sqrt(size))
            meters[TURN_MAX] = max(meters[TURN_MAX], abs(qpos[hinge] - meters[TURN_FROM]))
        for _ in range(stride):
            judge(meters, userdata[contact.PENETRATION], lasting)
        if hinge >= 0 and abs(qpos[hinge]) > lost:
            break
    total = 0.0
    for i in range(7):
        total += qpos[i] + qvel[i]
    return tick if math.isfinite(total) and abs(total) < 1e4 else 0


@njit(cache=True)
def _net_force(data: int, pivot: Vector, plates: int, force: Vector, torque: Vector) -> None:  # pragma: no cover
    """Write what the plates do to the peg, N, and its torque about the pivot, N·m, base frame."""
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
    """Return how far the middle of a peg's end lies below a hole's mouth and beside its axis, m.

    Args:
        half: Half the length of the peg, m.
        middle: Of the peg, shape (3,), m, base frame.
        axes: Of the peg, shape (3, 3), z from its end upward.
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
def judge(meters: Vector, penetration: float, ticks: int) -> None:  # pragma: no cover
    """Meter one tick's penetration: the least of the last `ticks` has lasted."""
    at = int(meters[RING_AT])
    meters[RING + at] = penetration
    meters[RING_AT] = float((at + 1) % ticks)
    lasting = meters[RING]
    for i in range(1, ticks):
        lasting = min(lasting, meters[RING + i])
    meters[SUSTAINED] = max(meters[SUSTAINED], lasting)


@njit(cache=True)
def replay(
    model: int,
    data: int,
    views: tuple[Vector, Vector, Vector, Vector, Vector],
    states: Vector,
    steps: int,
) -> None:  # pragma: no cover
    """Take bare steps from each of some states, with nothing around them: what a measurement of speed is held against.

    Args:
        model: Address of the mjModel.
        data: Address of the mjData.
        views: Of positions, velocities, applied forces, the solver's warm start, and joint friction.
        states: Rows of the five, one after the other.
        steps: From each state.
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
