"""The way from the commanded torque to the one that moves a joint, compiled: delay, rate limit, low-pass, the remainder
of gravity, and smooth friction. Dry friction and rotor inertia are the physics' own, see `sim.scene`.

The smooth friction is applied explicitly, as a torque at the velocity at the beginning of a step. That is stable and free
of ringing while slope · step is less than the joints' inertia, for which `stiffest` gives the figure: 0.14 on the Panda
without rotor inertia at 0.5 ms, 0.4 on the FR3. MuJoCo's own joint damping would be implicit, but its step solves contacts
with the undamped inertia and moves with the damped one, so that a contact is no longer kept to its distance.
"""

import math

import numpy as np

from drivers import impedance
from drivers.arm.inertia import joint_inertia
from drivers.arm.model import JOINTS
from drivers.compiled import njit
from drivers.quantities import Vector
from sim.arm_truth import LONGEST_DELAY, ArmTruth

GRAVITY = 9.81
"""Acceleration of gravity, m/s²."""

IS_IDEAL, DELAY, AT, RATE_STEP = 0, 1, 2, 3
"""Indices of single words: whether commands act as they are; delay, cycles; place of the newest command in the ring;
largest change in a cycle, N·m.
"""
BLEND = 4
"""Index of the shares of the way to its goal that the low-pass covers in a tick and in a long step."""
LOAD, LOAD_AT = 6, 7
"""Indices of the payload: its weight, N, and its place from the finger centre, finger frame, m."""
LEFT_OVER, SPAN, SLOPE, SHIFT, AT_REST, VISCOUS = 10, 17, 24, 31, 38, 45
"""Indices of seven words each: torque that gravity leaves over; the smooth friction's curve and its value at rest;
viscous friction.
"""
LOADED, ARRIVED, ACTING = 52, 59, 66
"""Indices of seven words each: torque of the payload; command at the end of transport and rate limit; torque behind the
low-pass, N·m.
"""
RING = 73
WORDS = RING + JOINTS * (LONGEST_DELAY + 1)


def words_of(truth: ArmTruth, period: float, steps: tuple[float, float]) -> Vector:
    """Return the words of a drive at rest, shape (WORDS,).

    Args:
        truth: True arm.
        period: Control period, s.
        steps: Lengths of a tick and of a long step, s.
    """
    words = np.zeros(WORDS)
    path, friction, hand = truth.path, truth.friction, truth.model.hand
    words[DELAY] = path.delay
    words[RATE_STEP] = path.rate * period
    words[BLEND : BLEND + 2] = [1.0 - math.exp(-2.0 * math.pi * path.cutoff * step) for step in steps]
    words[LOAD] = truth.payload.mass * GRAVITY
    x, y, z = truth.payload.at
    # The finger frame: x out of the hand, y and z along the hand's x and y.
    words[LOAD_AT : LOAD_AT + 3] = z - hand.finger_centre, x, y
    at_rest = [
        span / (1.0 + math.exp(-slope * shift))
        for span, slope, shift in zip(friction.span, friction.slope, friction.shift, strict=True)
    ]
    for place, values in (
        (LEFT_OVER, truth.gravity),
        (SPAN, friction.span),
        (SLOPE, friction.slope),
        (SHIFT, friction.shift),
        (AT_REST, at_rest),
        (VISCOUS, friction.viscous),
    ):
        words[place : place + JOINTS] = values
    is_smooth = any(friction.span) or any(friction.viscous)
    is_delayed = path.delay > 0 or math.isfinite(path.cutoff) or math.isfinite(path.rate)
    words[IS_IDEAL] = not (is_smooth or is_delayed or any(truth.gravity) or truth.payload.mass > 0.0)
    return words


def fill(words: Vector, tau: Vector) -> None:
    """Fill the ring as if all commands so far had been these torques, shape (7,), N·m."""
    words[ARRIVED : ARRIVED + JOINTS] = words[ACTING : ACTING + JOINTS] = tau
    words[RING:] = np.tile(tau, LONGEST_DELAY + 1)


def unmodelled(words: Vector) -> Vector:
    """Return the torques on the joints that the arm's controller does not know of, shape (7,), N·m."""
    total: Vector = words[LEFT_OVER : LEFT_OVER + JOINTS] + words[LOADED : LOADED + JOINTS]
    return total


def stiffest(truth: ArmTruth, q: Vector, step: float) -> float:
    """Return the largest relative change of a velocity by smooth friction in one step; the step is unstable at 2.

    Args:
        truth: True arm.
        q: Joint positions, shape (7,), rad.
        step: Time step, s.
    """
    M = joint_inertia(truth.model, q) + np.diag(truth.rotor_inertia)
    slopes = np.diag(truth.friction.steepest())
    return float(np.abs(np.linalg.eigvals(np.linalg.solve(M, slopes))).max()) * step


@njit(cache=True, inline="always")
def command(words: Vector, arm: Vector, q: Vector, tau: Vector, qfrc: Vector) -> None:  # pragma: no cover
    """Take the law's torques, once every control period.

    Args:
        words: The drive; updated.
        arm: Figures of the arm, see `drivers.impedance.figures`.
        q: True joint positions, shape (7,), rad.
        tau: Commanded torques, shape (7,), N·m.
        qfrc: Applied generalised forces; an ideal drive writes the commands there.
    """
    if words[IS_IDEAL] > 0.0:
        for i in range(JOINTS):
            qfrc[i] = tau[i]
        return
    at = (int(words[AT]) + 1) % (LONGEST_DELAY + 1)
    words[AT] = at
    then = (at - int(words[DELAY])) % (LONGEST_DELAY + 1)
    for i in range(JOINTS):
        words[RING + JOINTS * at + i] = tau[i]
    most = words[RATE_STEP]
    for i in range(JOINTS):
        last = words[ARRIVED + i]
        words[ARRIVED + i] = min(max(words[RING + JOINTS * then + i], last - most), last + most)
    if words[LOAD] > 0.0:
        position, finger, axes, origins = impedance.forward(arm, q)
        x, y = position[0], position[1]
        for k in range(3):
            x += finger[0, k] * words[LOAD_AT + k]
            y += finger[1, k] * words[LOAD_AT + k]
        for i in range(JOINTS):
            # A weight W at p has the torque axis · ((p - origin) × (0, 0, -W)) about a joint.
            across = axes[i, 1] * (x - origins[i, 0]) - axes[i, 0] * (y - origins[i, 1])
            words[LOADED + i] = words[LOAD] * across


@njit(cache=True, inline="always")
def act(words: Vector, qvel: Vector, qfrc: Vector, is_long: bool) -> None:  # pragma: no cover
    """Write the torques of the step that begins now into the applied forces.

    Args:
        words: The drive; updated.
        qvel: Velocities, the arm's seven first, rad/s.
        qfrc: Applied generalised forces.
        is_long: Whether it is a long step.
    """
    if words[IS_IDEAL] > 0.0:
        return
    blend = words[BLEND + 1] if is_long else words[BLEND]
    for i in range(JOINTS):
        acting = words[ACTING + i] + blend * (words[ARRIVED + i] - words[ACTING + i])
        words[ACTING + i] = acting
        qfrc[i] = acting + words[LEFT_OVER + i] + words[LOADED + i] - friction(words, i, qvel[i])


@njit(cache=True, inline="always")
def friction(words: Vector, joint: int, dq: float) -> float:  # pragma: no cover
    """Return the smooth friction of a joint, counted from 0, at a velocity, rad/s, N·m; it opposes the motion."""
    torque: float = words[VISCOUS + joint] * dq
    if words[SPAN + joint] > 0.0:
        # The exponent is bounded: beyond it the curve is flat to the last digit.
        exponent = min(max(-words[SLOPE + joint] * (dq + words[SHIFT + joint]), -40.0), 40.0)
        torque += words[SPAN + joint] / (1.0 + math.exp(exponent)) - words[AT_REST + joint]
    return torque
