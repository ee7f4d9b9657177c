"""Path from the commanded torque to the joint torque, compiled: delay, low-pass, gravity, smooth friction.

Gravity is the residual torque after compensation. MuJoCo models dry friction and rotor inertia itself, see
`sim.world.scene`.

The smooth friction is explicit: a torque computed from the velocity at the beginning of a step. It is stable and free
of ringing if slope · step is less than the joints' inertia. `stiffest` returns the ratio of slope · step to inertia: 0.14
on the Panda without rotor inertia at 0.5 ms, 0.4 on the FR3. MuJoCo's own joint damping is implicit, but its step solves
contacts with the undamped inertia and moves with the damped inertia. A contact would then not keep its distance.
"""

import math

import numpy as np

from drivers.arm.inertia import joint_inertia
from drivers.arm.model import JOINTS
from drivers.compiled import njit
from drivers.quantities import Vector
from sim.arm.arm_truth import LONGEST_DELAY, ArmTruth

IS_IDEAL, DELAY, AT = 0, 1, 2
"""Indices of single words: 1 if commands act unchanged; delay, cycles; index of the newest command in the ring."""
BLEND = 3
"""Index of the low-pass coefficients for a tick and for a long step, fraction."""
LEFT_OVER, SPAN, SLOPE, SHIFT, AT_REST, VISCOUS = 5, 12, 19, 26, 33, 40
"""Indices of seven words each: residual gravity torque; smooth friction's curve and value at rest; viscous friction."""
ARRIVED, ACTING = 47, 54
"""Indices of seven words each: command after transport; torque after the low-pass, N·m."""
RING = 61
WORDS = RING + JOINTS * (LONGEST_DELAY + 1)


def words_of(truth: ArmTruth, steps: tuple[float, float]) -> Vector:
    """Return the words of a drive at rest, shape (WORDS,).

    Args:
        truth: True arm.
        steps: Lengths of a tick and of a long step, s.
    """
    words = np.zeros(WORDS)
    path, friction = truth.path, truth.friction
    words[DELAY] = path.delay
    # Low-pass coefficient for a step h: 1 - exp(-2 pi f_c h).
    words[BLEND : BLEND + 2] = [1.0 - math.exp(-2.0 * math.pi * path.cutoff * step) for step in steps]
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
    is_delayed = path.delay > 0 or math.isfinite(path.cutoff)
    words[IS_IDEAL] = not (is_smooth or is_delayed or any(truth.gravity))
    return words


def fill(words: Vector, tau: Vector) -> None:
    """Fill the ring with these torques, shape (7,), N·m."""
    words[ARRIVED : ARRIVED + JOINTS] = words[ACTING : ACTING + JOINTS] = tau
    words[RING:] = np.tile(tau, LONGEST_DELAY + 1)


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
def command(words: Vector, tau: Vector, qfrc: Vector) -> None:  # pragma: no cover
    """Accept the law's torques, once every control period.

    Args:
        words: The drive; updated.
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
    for i in range(JOINTS):
        words[ARRIVED + i] = words[RING + JOINTS * then + i]


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
        # Low-pass: y <- y + b (a - y). Joint torque: y + residual gravity - friction.
        acting = words[ACTING + i] + blend * (words[ARRIVED + i] - words[ACTING + i])
        words[ACTING + i] = acting
        qfrc[i] = acting + words[LEFT_OVER + i] - friction(words, i, qvel[i])


@njit(cache=True, inline="always")
def friction(words: Vector, joint: int, dq: float) -> float:  # pragma: no cover
    """Return a joint's smooth friction torque relative to rest, N·m, at a velocity, rad/s; it opposes the motion."""
    # f(dq) = viscous·dq + span / (1 + exp(-slope (dq + shift))) - f_rest.
    torque: float = words[VISCOUS + joint] * dq
    if words[SPAN + joint] > 0.0:
        # The exponent is bounded; beyond the bounds the curve is constant within rounding.
        exponent = min(max(-words[SLOPE + joint] * (dq + words[SHIFT + joint]), -40.0), 40.0)
        torque += words[SPAN + joint] / (1.0 + math.exp(exponent)) - words[AT_REST + joint]
    return torque
