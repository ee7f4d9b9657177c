"""Path from the commanded torque to the joint torque, compiled: delay, rate limit, low-pass, gravity, smooth friction.

Gravity is the residual torque after compensation, plus the payload. MuJoCo models dry friction and rotor inertia
itself, see `sim.world.scene`.

The smooth friction is explicit: a torque computed from the velocity at the beginning of a step. It is stable and free
of ringing if slope · step is less than the joints' inertia. `stiffest` returns this ratio: 0.14 on the Panda without
rotor inertia at 0.5 ms, 0.4 on the FR3. MuJoCo's own joint damping is implicit, but its step solves contacts with the
undamped inertia and moves with the damped one. A contact would then lose its distance.
"""

import math

import numpy as np

from drivers import impedance
from drivers.arm.inertia import joint_inertia
from drivers.arm.model import JOINTS
from drivers.compiled import njit
from drivers.quantities import Vector
from sim.arm.arm_truth import LONGEST_DELAY, ArmTruth

GRAVITY = 9.81
"""Acceleration of gravity, m/s²."""

IS_IDEAL, DELAY, AT, RATE_STEP = 0, 1, 2, 3
"""Indices of single words: 1 if commands act unchanged; delay, cycles; index of the newest command in the ring; largest
change in a cycle, N·m."""
BLEND = 4
"""Index of the low-pass coefficients for a tick and for a long step, fraction."""
LOAD, LOAD_AT = 6, 7
"""Indices of the payload: its weight, N, and its position from the finger centre, finger frame, m."""
LEFT_OVER, SPAN, SLOPE, SHIFT, AT_REST, VISCOUS = 10, 17, 24, 31, 38, 45
"""Indices of seven words each: residual gravity torque; the smooth friction's curve and its value at rest; viscous
friction."""
LOADED, ARRIVED, ACTING = 52, 59, 66
"""Indices of seven words each: torque of the payload; command after transport and rate limit; torque after the
low-pass, N·m."""
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
    # Low-pass coefficient for a step h: 1 - exp(-2 pi f_c h).
    words[BLEND : BLEND + 2] = [1.0 - math.exp(-2.0 * math.pi * path.cutoff * step) for step in steps]
    words[LOAD] = truth.payload.mass * GRAVITY
    x, y, z = truth.payload.at
    # Finger frame: x out of the hand, y and z along the hand's x and y.
    words[LOAD_AT : LOAD_AT + 3] = z - hand.finger_centre, x, y
    # Smooth friction at rest: span / (1 + exp(-slope·shift)).
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
    """Fill the ring with these torques, shape (7,), N·m."""
    words[ARRIVED : ARRIVED + JOINTS] = words[ACTING : ACTING + JOINTS] = tau
    words[RING:] = np.tile(tau, LONGEST_DELAY + 1)


def unmodelled(words: Vector) -> Vector:
    """Return the joint torques that are missing in the model of the arm's controller, shape (7,), N·m."""
    total: Vector = words[LEFT_OVER : LEFT_OVER + JOINTS] + words[LOADED : LOADED + JOINTS]
    return total


def stiffest(truth: ArmTruth, q: Vector, step: float) -> float:
    """Return the largest relative change of a velocity by smooth friction in one step.

    The step is unstable at 2.

    Args:
        truth: True arm.
        q: Joint positions, shape (7,), rad.
        step: Time step, s.
    """
    # max |eig(M⁻¹ D)| · step, with the friction slopes D on the diagonal.
    M = joint_inertia(truth.model, q) + np.diag(truth.rotor_inertia)
    slopes = np.diag(truth.friction.steepest())
    return float(np.abs(np.linalg.eigvals(np.linalg.solve(M, slopes))).max()) * step


@njit(cache=True, inline="always")
def command(words: Vector, arm: Vector, q: Vector, tau: Vector, qfrc: Vector) -> None:  # pragma: no cover
    """Accept the law's torques, once every control period.

    Args:
        words: The drive; updated.
        arm: Figures of the arm, see `drivers.impedance.figures`.
        q: True joint positions, shape (7,), rad.
        tau: Commanded torques, shape (7,), N·m.
        qfrc: Applied generalised forces; the commands are written there if the drive is ideal.
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
        # Rate limit on the delayed command: a_k = min(max(tau_{k-delay}, a_{k-1} - r T), a_{k-1} + r T).
        words[ARRIVED + i] = min(max(words[RING + JOINTS * then + i], last - most), last + most)
    if words[LOAD] > 0.0:
        position, finger, axes, origins = impedance.forward(arm, q)
        x, y = position[0], position[1]
        for k in range(3):
            x += finger[0, k] * words[LOAD_AT + k]
            y += finger[1, k] * words[LOAD_AT + k]
        for i in range(JOINTS):
            # A weight W at p exerts the torque axis · ((p - origin) × (0, 0, -W)) about a joint.
            across = axes[i, 1] * (x - origins[i, 0]) - axes[i, 0] * (y - origins[i, 1])
            words[LOADED + i] = words[LOAD] * across


@njit(cache=True, inline="always")
def act(words: Vector, qvel: Vector, qfrc: Vector, is_long: bool) -> None:  # pragma: no cover
    """Write the torques of the coming step into the applied forces.

    Args:
        words: The drive; updated.
        qvel: Velocities, the arm's seven first, rad/s.
        qfrc: Applied generalised forces.
        is_long: True if the step is a long one.
    """
    if words[IS_IDEAL] > 0.0:
        return
    blend = words[BLEND + 1] if is_long else words[BLEND]
    for i in range(JOINTS):
        # Low-pass: y <- y + b (a - y). Joint torque: y + residual gravity + payload - friction.
        acting = words[ACTING + i] + blend * (words[ARRIVED + i] - words[ACTING + i])
        words[ACTING + i] = acting
        qfrc[i] = acting + words[LEFT_OVER + i] + words[LOADED + i] - friction(words, i, qvel[i])


@njit(cache=True, inline="always")
def friction(words: Vector, joint: int, dq: float) -> float:  # pragma: no cover
    """Return a joint's smooth friction torque relative to rest, N·m, at a velocity, rad/s; it opposes the motion."""
    # f(dq) = viscous·dq + span / (1 + exp(-slope (dq + shift))) - f_rest.
    torque: float = words[VISCOUS + joint] * dq
    if words[SPAN + joint] > 0.0:
        # The exponent is bounded; beyond the bounds the curve is constant to the last digit.
        exponent = min(max(-words[SLOPE + joint] * (dq + words[SHIFT + joint]), -40.0), 40.0)
        torque += words[SPAN + joint] / (1.0 + math.exp(exponent)) - words[AT_REST + joint]
    return torque
