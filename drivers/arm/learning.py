"""Joint torques beyond the rigid-body model, learnt while the hand moves freely; pure and compiled.

A momentum observer ([deluca]) estimates each joint's disturbance: the commanded torque that did not become motion.
If nothing touches the hand, the disturbance is friction, the residual of the arm's gravity compensation, and the rotor
inertia that the model lacks:

    disturbance = dry · tanh(dq / DRY_RATE) + smooth · tanh(dq / SMOOTH_RATE) + offset + rotor · ddq

Recursive least squares estimate the four figures of each joint, starting from a prior mean and standard deviation. At
rest, friction has any value between -dry and dry. A joint at rest therefore changes its figures only if the disturbance
exceeds this bound; this separates friction from offset, even if the joint has moved in one direction only. Implausibly
large disturbances are ignored; otherwise an arm that is held back would push ever harder.

The law feeds forward the offset, and the friction of the commanded motion. The sign of this friction comes from the
setpoint, which closes no feedback loop; a sign from the measured velocity would close one.
"""

import math

import numpy as np

from drivers.arm.model import JOINTS, ArmModel
from drivers.compiled import njit
from drivers.quantities import Vector

FIGURES = 4
DRY, SMOOTH, OFFSET, ROTOR = 0, 1, 2, 3
"""Indices of the learnt figures of each joint: dry friction, friction that grows with velocity, and offset, N·m;
rotor inertia beyond the model's, kg·m².
"""

DRY_RATE = 0.02
"""Velocity at which dry friction has three quarters of its level, rad/s."""
SMOOTH_RATE = 0.25
"""Velocity at which smooth friction has three quarters of its level, rad/s; 0.1 to 0.4 in the published sigmoids."""

CYCLES = 5
"""Number of control cycles between two updates; the learnt figures change more slowly."""
BANDWIDTH = 30.0
"""Bandwidth of the momentum observer, 1/s."""
NOISE = 0.1
"""Standard deviation of the disturbance from the four figures' prediction, within the observer's time constant, N·m."""

FRICTION_SHARE = 0.8
"""Share of the learnt friction that is fed forward, fraction; more than the real friction would drive the arm."""
MOST_OFFSET = 5.0
"""Largest offset that is fed forward, N·m; a payload of 0.7 kg at arm's length causes as much."""

COUNT, IS_BEGUN, COMMANDED, INTEGRAL, RESIDUAL = 0, 1, 2, 9, 16
"""Indices of the number of cycles since the last update; of a flag that the first update sets; of the mean commanded
torques since the last update; of the observer's integrals; of the observer's residuals.
"""
PASSED = 23
"""Index of three words for each joint after the observer's low-pass: dry and smooth friction of level one, and velocity."""
PRIOR = PASSED + 3 * JOINTS
"""Index of the standard deviations of all figures before learning."""
MOST = PRIOR + FIGURES * JOINTS
"""Index of the largest plausible disturbance of each joint, N·m: its first figures plus three standard deviations of an
unmeasured arm.
"""
LEARNT = MOST + JOINTS
COVARIANCE = LEARNT + FIGURES * JOINTS
WORDS = COVARIANCE + FIGURES * FIGURES * JOINTS


def doubts(arm: ArmModel) -> Vector:
    """Return the standard deviation of each figure before learning, shape (7, 4)."""
    friction, offset = np.array(arm.joints.friction), np.array(arm.joints.offset)
    # Standard deviation of the rotor inertia beyond the model's, before learning, kg·m².
    return np.column_stack([friction, friction, offset, np.full(JOINTS, 0.1)])


def begin(state: Vector, arm: ArmModel, believed: tuple[Vector, Vector] | None = None) -> None:
    """Reset the learning.

    Args:
        state: State of the learning, shape (WORDS,).
        arm: Figures of the arm.
        believed: Initial figures and their standard deviations, each shape (7, 4); None starts from zero with `doubts`.
    """
    doubt = doubts(arm)
    figures, deviations = believed or (np.zeros_like(doubt), doubt)
    state[:] = 0.0
    state[PRIOR:MOST] = deviations.flatten()
    state[MOST:LEARNT] = np.abs(figures[:, :ROTOR]).sum(axis=1) + 3.0 * np.sqrt((doubt[:, :ROTOR] ** 2).sum(axis=1))
    state[LEARNT:COVARIANCE] = figures.flatten()
    for joint in range(JOINTS):
        place = COVARIANCE + FIGURES * FIGURES * joint
        state[place : place + FIGURES * FIGURES] = np.diag(deviations[joint] ** 2).flatten()


def pause(state: Vector) -> None:
    """Restart the observer at the next update and keep the learnt figures; `state` has shape (WORDS,)."""
    state[:PRIOR] = 0.0


@njit(cache=True, inline="always")
def observe(state: Vector, M: Vector, dq: Vector, period: float, is_free: bool) -> None:  # pragma: no cover
    """Update the observer by the torques commanded since the last update, and learn if the hand moves freely.

    Args:
        state: State of the learning, shape (WORDS,); updated.
        M: Mass matrix, shape (7, 7), kg·m².
        dq: Joint velocities, shape (7,), rad/s.
        period: Time since the last update, s.
        is_free: True if nothing touches the hand, so that the disturbance is the joints' own.
    """
    # Velocity below which a joint counts as at rest, rad/s; dry friction may then have any value up to its level.
    moving = 0.03
    share = period * BANDWIDTH / (1.0 + period * BANDWIDTH)
    # p = M dq,  r = K (p - ∫ (tau + r) dt);  the disturbance is -r. All regressors pass a low-pass of the same bandwidth K.
    for i in range(JOINTS):
        momentum = 0.0
        for j in range(JOINTS):
            momentum += M[i, j] * dq[j]
        if state[IS_BEGUN] == 0.0:  # an arm at rest: all torque is disturbance
            state[RESIDUAL + i] = -state[COMMANDED + i]
            state[INTEGRAL + i] = momentum + state[COMMANDED + i] / BANDWIDTH
        state[INTEGRAL + i] += period * (state[COMMANDED + i] + state[RESIDUAL + i])
        state[COMMANDED + i] = 0.0
        state[RESIDUAL + i] = BANDWIDTH * (momentum - state[INTEGRAL + i])
        dry, smooth, speed = PASSED + 3 * i, PASSED + 3 * i + 1, PASSED + 3 * i + 2
        before = state[speed]
        state[dry] += share * (math.tanh(dq[i] / DRY_RATE) - state[dry])
        state[smooth] += share * (math.tanh(dq[i] / SMOOTH_RATE) - state[smooth])
        state[speed] += share * (dq[i] - before)
        disturbance, acceleration = -state[RESIDUAL + i], (state[speed] - before) / period
        if not is_free or abs(disturbance) > state[MOST + i]:
            continue
        known = LEARNT + FIGURES * i
        slack = disturbance - state[known + OFFSET] - state[known + ROTOR] * acceleration
        if abs(state[speed]) > moving and abs(state[dry]) > 0.9:
            _learn(state, i, np.array([state[dry], state[smooth], 1.0, acceleration]), disturbance, period)
        elif abs(state[speed]) < moving and abs(slack) > state[known + DRY] + NOISE:
            # |disturbance - offset - rotor ddq| <= dry at rest. If the figures violate this, friction is at its bound.
            _learn(state, i, np.array([math.copysign(1.0, slack), 0.0, 1.0, acceleration]), disturbance, period)
    state[COUNT], state[IS_BEGUN] = 0.0, 1.0


@njit(cache=True, inline="always")
def _learn(state: Vector, joint: int, explains: Vector, disturbance: float, period: float) -> None:  # pragma: no cover
    """Update a joint's figures by one disturbance: recursive least squares with forgetting."""
    known = state[LEARNT + FIGURES * joint : LEARNT + FIGURES * (joint + 1)]
    place = COVARIANCE + FIGURES * FIGURES * joint
    P = state[place : place + FIGURES * FIGURES].reshape((FIGURES, FIGURES))
    # With regressor h, disturbance y and noise variance R:  k = P h / (R + hᵀ P h),  x += k (y - hᵀ x),  P -= k hᵀ P.
    towards = np.zeros(FIGURES)
    # Disturbances within the observer's time constant are correlated, so each counts for less.
    spread, error = NOISE**2 / (period * BANDWIDTH), disturbance
    for k in range(FIGURES):
        first = state[PRIOR + FIGURES * joint + k] ** 2
        # Time of free motion in which a learnt figure's variance grows back to its first value, s; joints warm up.
        P[k, k] = min(P[k, k] + first * period / 60.0, first)
        error -= explains[k] * known[k]
    for k in range(FIGURES):
        for j in range(FIGURES):
            towards[k] += P[k, j] * explains[j]
        spread += explains[k] * towards[k]
    for k in range(FIGURES):
        known[k] += towards[k] / spread * error
        for j in range(FIGURES):
            P[k, j] -= towards[k] * towards[j] / spread


@njit(cache=True)
def feed_forward(state: Vector, joint: int, wanted: float) -> float:  # pragma: no cover
    """Return the torque that compensates a joint's learnt offset and friction, N·m.

    Args:
        state: State of the learning, shape (WORDS,).
        joint: Number of the joint, from 0.
        wanted: Commanded velocity, rad/s.
    """
    # tau = offset + FRICTION_SHARE (dry tanh(w / DRY_RATE) + smooth tanh(w / SMOOTH_RATE)); levels >= 0, |offset| <= MOST_OFFSET.
    place = LEARNT + FIGURES * joint
    friction = max(state[place + DRY], 0.0) * math.tanh(wanted / DRY_RATE)
    friction += max(state[place + SMOOTH], 0.0) * math.tanh(wanted / SMOOTH_RATE)
    offset = min(max(state[place + OFFSET], -MOST_OFFSET), MOST_OFFSET)
    torque: float = offset + FRICTION_SHARE * friction
    return torque


@njit(cache=True, inline="always")
def sure_rotor(state: Vector, joint: int) -> float:  # pragma: no cover
    """Return a lower estimate of the rotor inertia beyond the model's, learnt mean less one standard deviation, >= 0, kg·m².

    If the damping assumes too much inertia, the arm oscillates, because its torques act late. If the damping assumes too
    little inertia, the arm brakes more slowly.

    Args:
        state: State of the learning, shape (WORDS,).
        joint: Number of the joint, from 0.
    """
    variance = state[COVARIANCE + FIGURES * FIGURES * joint + FIGURES * ROTOR + ROTOR]
    sure: float = state[LEARNT + FIGURES * joint + ROTOR] - math.sqrt(max(variance, 0.0))
    return max(sure, 0.0)
