"""Meters of the physics, compiled: plate force on the peg, sustained penetrations, in-hand rotation, and the hand's jerk."""

import math
from typing import NamedTuple

import numpy as np

from drivers.compiled import njit
from drivers.quantities import Vector
from sim.contact import table as contact
from sim.world import native

FORCE, TORQUE, PEAK_FORCE = 0, 3, 6
"""Indices of meters: net force of the plates on the peg and its torque about the finger centre, base frame, low-passed,
N and N·m; largest force, N."""
SUSTAINED, RING_AT, TURN_FROM, TURN_MAX = 7, 8, 9, 10
"""Indices of meters: deepest sustained penetration of a bore or its rim, m; index of its ring; reference hinge angle of
the rotation, and largest rotation, rad."""
OVER_TIME, SURFACE_SUSTAINED = 11, 12
"""Indices of meters: time with a force above `OVER_FORCE`, s; deepest sustained penetration of surface or floor, m."""
JERK_FREE, JERK_CONTACT = 13, 14
"""Indices of meters: largest jerk of the finger centre during commanded motion in free space, and otherwise, m/s³."""
RING, SURFACE_RING = 20, 70
"""Indices of the rings with the newest ticks' penetrations, of bores and rims and of surfaces and floors."""

VELOCITY, ACCELERATION = 112, 115
"""Indices of the finger centre's low-passed velocity, m/s, and acceleration, m/s², base frame; see `JERK_BANDWIDTH`."""

JERK_BANDWIDTH = 10.0
"""Corner frequency of the second-order Butterworth low-pass of the jerk, as in [r79], Hz. With the default stiffness
the hand oscillates at 2 to 5 Hz. If an impact stops the hand within a step, the jerk is its change of speed times (2 pi
10 Hz)², independent of the stopping time: 200 m/s³ for 0.05 m/s."""
OVER_FORCE = 20.0
"""Force on the peg above which time is counted, N."""


class HandView(NamedTuple):
    """Views of the hand in the physics, base frame."""

    velocity: Vector
    """Angular, then linear velocity of the last link at `reference`, shape (6,), rad/s and m/s."""
    reference: Vector
    """Reference point of `velocity` on the last link, shape (3,), m."""
    left: Vector
    """Position of one finger, or the finger centre, shape (3,), m; the finger centre is half-way to `right`."""
    right: Vector


def new_meters() -> Vector:
    """Return meters at zero, shape (METER_WORDS,)."""
    # Number of words of the meters.
    return np.zeros(128)


@njit(cache=True, inline="always")
def window(timestep: float) -> int:  # pragma: no cover
    """Return the number of ticks of `timestep`, s, after which a penetration is sustained."""
    # Shortest duration of a sustained penetration, s.
    return math.floor(0.002 / timestep + 0.5) + 1


@njit(cache=True, inline="always")
def take(
    meters: Vector, force: Vector, torque: Vector, elapsed: float, hinge: int, qpos: Vector
) -> None:  # pragma: no cover
    """Update the meters with the net force, N, and torque, N·m, of a step of `elapsed`, s, and the held peg's rotation."""
    # First-order low-pass, implicit Euler: y <- y + h / (T + h) (f - y).
    # Time constant of the force's low-pass of 32 Hz, s; single steps of a rigid contact carry no information.
    blend = elapsed / (0.005 + elapsed)
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


@njit(cache=True, inline="always")
def take_jerk(meters: Vector, hand: HandView, elapsed: float, is_free: bool) -> None:  # pragma: no cover
    """Meter the jerk of the finger centre in a step of `elapsed`, s: the rate of change of its low-passed acceleration.

    The low-pass is a' = w² (v - u) - sqrt(2) w a, u' = a, with w = 2 pi `JERK_BANDWIDTH`. The trapezoidal rule
    integrates it with the velocity v constant over the step, so that steps can have any length.

    Args:
        meters: Meters, updated.
        hand: The hand.
        elapsed: Length of the step, s.
        is_free: True during commanded motion in free space.
    """
    spin, speed = hand.velocity[:3], hand.velocity[3:]
    x, y, z = (
        (hand.left[0] + hand.right[0]) / 2.0 - hand.reference[0],
        (hand.left[1] + hand.right[1]) / 2.0 - hand.reference[1],
        (hand.left[2] + hand.right[2]) / 2.0 - hand.reference[2],
    )
    velocity = (
        speed[0] + spin[1] * z - spin[2] * y,
        speed[1] + spin[2] * x - spin[0] * z,
        speed[2] + spin[0] * y - spin[1] * x,
    )
    rate = 2.0 * math.pi * JERK_BANDWIDTH
    stiff, damped = elapsed * rate * rate, elapsed * math.sqrt(2.0) * rate
    size = 0.0
    for i in range(3):
        smooth, before = meters[VELOCITY + i], meters[ACCELERATION + i]
        # Trapezoidal rule: a1 + a0 = (2 a0 + h w² (v - u0)) / (1 + sqrt(2) w h / 2 + w² h² / 4), jerk = |a1 - a0| / h.
        both = (2.0 * before + stiff * (velocity[i] - smooth)) / (1.0 + damped / 2.0 + stiff * elapsed / 4.0)
        meters[VELOCITY + i] = smooth + elapsed / 2.0 * both
        meters[ACCELERATION + i] = both - before
        size += (both - 2.0 * before) ** 2
    at = JERK_FREE if is_free else JERK_CONTACT
    meters[at] = max(meters[at], math.sqrt(size) / elapsed)


@njit(cache=True, inline="always")
def net_force(data: int, pivot: Vector, plates: int, force: Vector, torque: Vector) -> None:  # pragma: no cover
    """Write the force of the plates on the peg, N, and its torque about the pivot, N·m, base frame."""
    for i in range(3):
        force[i] = torque[i] = 0.0
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
    """Return the smaller of the contact forces on two geoms, the pads, N."""
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


@njit(cache=True, inline="always")
def clear(userdata: Vector) -> None:  # pragma: no cover
    """Reset the penetrations of the contact functions to 0."""
    userdata[contact.PENETRATION] = userdata[contact.SURFACE] = 0.0


@njit(cache=True, inline="always")
def judge(meters: Vector, userdata: Vector, ticks: int) -> None:  # pragma: no cover
    """Meter one tick's penetrations.

    The minimum over the newest `ticks` is the sustained depth.
    """
    at = int(meters[RING_AT])
    meters[RING + at] = userdata[contact.PENETRATION]
    meters[SURFACE_RING + at] = userdata[contact.SURFACE]
    meters[RING_AT] = float((at + 1) % ticks)
    in_bore = at_surface = math.inf
    for tick in range(ticks):
        in_bore = min(in_bore, meters[RING + tick])
        at_surface = min(at_surface, meters[SURFACE_RING + tick])
    meters[SUSTAINED] = max(meters[SUSTAINED], in_bore)
    meters[SURFACE_SUSTAINED] = max(meters[SURFACE_SUSTAINED], at_surface)
