"""The impedance law at the peg's tip, [gibbons], Eq. (5)-(6): one law for hardware and simulation; pure and compiled.

The law runs at 1 kHz. It computes x_p, v and J_p from the current joint positions and the held in-hand angle; only this
angle, theta, is as old as the last tactile frame. The law reads the setpoint as the words of `drivers.setpoint_words`.

Four places differ from the printed equations:
- the orientation error e is (v* x v)·phi / |v* x v|: with the printed order, -K e would turn the peg away from v*;
- phi is atan2(|v x v*|, v·v*), exact near alignment;
- damping acts on the tip's twist minus the setpoint's; otherwise the tip would lag by D·v/K along a path;
- the setpoint holds a damping ratio instead of D; the law computes D from the arm's inertia at the tip in its present pose.
"""

import math

import numpy as np

from drivers.arm import dynamics, learning
from drivers.arm.model import JOINTS, ArmModel
from drivers.compiled import njit
from drivers.quantities import Vector
from drivers.setpoint_words import (
    AXIS,
    DAMPING_RATIO,
    HAS_HAND,
    HAS_POSTURE,
    HAS_ROLL,
    ID,
    INTEGRAL_GAIN,
    INTEGRAL_LIMIT,
    IS_FREE,
    LENGTH,
    POSTURE,
    ROLL,
    STIFFNESS,
    THETA,
    TIP,
    TWIST,
    VALID_UNTIL,
)

INTEGRAL, SEEN_ID, TORQUE, IS_HOLDING, DAMPED_SINCE, DAMPING = 0, 3, 4, 11, 12, 13
HELD = DAMPING + 36
WEIGHED_SINCE = HELD + JOINTS
INERTIA = WEIGHED_SINCE + 1
LEARNING = INERTIA + JOINTS * JOINTS
STATE_WORDS = LEARNING + learning.WORDS
"""Indices of the law's state between steps. For every motion: the integral's torque, the id of the motion, the last torque,
a flag for holding still, the time of the damping, s, and the damping at the tip, shape (6, 6). For an arm that holds still:
the held joint positions, rad, the time of the inertia, s, and the inertia, shape (7, 7), kg·m². The words of
`drivers.arm.learning` follow; `STATE_WORDS` is the number of all words."""
RESIDUAL = LEARNING + learning.RESIDUAL
"""Index of the residuals of the momentum observer, shape (7,): the motion that the commanded torques do not explain, N·m."""
DAMPING_PERIOD = 0.01
"""Time between two computations of damping or inertia, s; at 1 rad/s the inertia changes by about 1 % during this time."""

NULL_STIFFNESS = 10.0
"""Stiffness of the null space towards the posture, N·m/rad."""
NULL_DAMPING = 3.0
"""Damping of the null space, N·m·s/rad."""

HOLD_RATE = 25.0
"""Rate of every mode of an arm that holds still, rad/s; each mode is critically damped. While halts repeat, the arm's momentum
decays at twice this rate. Source: `cell.config.torque_path`, which derives the stable rates of an arm, and decision 0014."""
ROTOR_RANGE = 5.0
"""Upper bound on a rotor's inertia with its learnt part while an arm holds still, multiple of its least share that acts
at the joint, `torque_path.rotor_share`. Source: decision 0014."""

MASSES = 45
MOST_LEARNT = MASSES + dynamics.WORDS
FIGURES = MOST_LEARNT + JOINTS
DH_A, DH_D, COS_ALPHA, SIN_ALPHA, TORQUE_MAX, TORQUE_RATE = 0, 7, 14, 21, 28, 35
REACH, TURN_COS, TURN_SIN = 42, 43, 44
"""Indices of the arm's figures in the law's words: kinematics; limits; distance from the last joint's frame to the finger
centre, m; the hand's turn about the flange. The masses of `drivers.arm.dynamics` follow at `MASSES`, and the upper bound on
each rotor's learnt inertia, kg·m², at `MOST_LEARNT`."""


def figures(arm: ArmModel) -> Vector:
    """Return an arm's kinematics, limits and masses as the words of the compiled functions, shape (FIGURES,)."""
    words = np.zeros(FIGURES)
    dh, joints = arm.kinematics, arm.joints
    alpha = np.array(dh.alpha)
    for place, values in (
        (DH_A, dh.a),
        (DH_D, dh.d),
        (COS_ALPHA, np.cos(alpha)),
        (SIN_ALPHA, np.sin(alpha)),
        (TORQUE_MAX, joints.torque),
        (TORQUE_RATE, joints.torque_rate),
    ):
        words[place : place + JOINTS] = values
    words[REACH] = dh.flange + arm.hand.finger_centre
    words[TURN_COS], words[TURN_SIN] = math.cos(arm.hand.turn), math.sin(arm.hand.turn)
    words[MASSES:MOST_LEARNT] = dynamics.masses(arm)
    words[MOST_LEARNT:] = most_learnt(arm)
    return words


def most_learnt(arm: ArmModel) -> Vector:
    """Return the upper bound on each rotor's learnt inertia beyond the model's while the arm holds still, shape (7,), kg·m²."""
    most: Vector = max(ROTOR_RANGE * arm.torque_path.rotor_share - 1.0, 0.0) * np.array(arm.joints.rotor_inertia)
    return most


def new_state(arm: ArmModel, believed: tuple[Vector, Vector] | None = None) -> Vector:
    """Return the state of the law before its first step, shape (STATE_WORDS,).

    Args:
        arm: Figures of the arm.
        believed: Initial figures of the learning and their standard deviations, see `learning.begin`.
    """
    state = np.zeros(STATE_WORDS)
    learning.begin(state[LEARNING:], arm, believed)
    return state


def commanded(state: Vector) -> Vector:
    """Return the torque on each joint that the law commanded last, shape (7,), N·m."""
    return state[TORQUE : TORQUE + JOINTS].copy()


def unexplained(state: Vector) -> Vector:
    """Return the commanded torque that did not become motion, one value a joint, shape (7,), N·m; `state` is the law's."""
    return -state[RESIDUAL : RESIDUAL + JOINTS]


def restart(state: Vector) -> None:
    """Reset the state but keep the learnt figures of the joints; the torques start from zero."""
    state[:LEARNING] = 0.0
    learning.pause(state[LEARNING:])


@njit(cache=True)
def links(arm: Vector, q: Vector) -> tuple[Vector, Vector]:  # pragma: no cover
    """Return the frames of the joints, base frame.

    Args:
        arm: Figures of the arm, from `figures`.
        q: Joint positions, shape (7,), rad.

    Returns:
        Their axes as columns, z along the joint's axis, shape (7, 3, 3); their origins, shape (7, 3), m.
    """
    R = np.zeros((3, 3))
    R[0, 0] = R[1, 1] = R[2, 2] = 1.0
    o = np.zeros(3)
    rotations = np.empty((7, 3, 3))
    origins = np.empty((7, 3))
    # T_(i-1)_i = Rot_x(alpha) Trans_x(a) Rot_z(q) Trans_z(d), Craig's modified Denavit-Hartenberg convention.
    for i in range(7):
        ca, sa, a, d = arm[COS_ALPHA + i], arm[SIN_ALPHA + i], arm[DH_A + i], arm[DH_D + i]
        for k in range(3):
            o[k] += R[k, 0] * a - R[k, 1] * sa * d + R[k, 2] * ca * d
        c, s = math.cos(q[i]), math.sin(q[i])
        for k in range(3):
            r0, r1, r2 = R[k, 0], R[k, 1] * ca + R[k, 2] * sa, -R[k, 1] * sa + R[k, 2] * ca
            rotations[i, k, 0], rotations[i, k, 1], rotations[i, k, 2] = r0 * c + r1 * s, r1 * c - r0 * s, r2
            origins[i, k] = o[k]
        R = rotations[i]
    return rotations, origins


@njit(cache=True, inline="always")
def finger_of(arm: Vector, rotation: Vector, origin: Vector) -> tuple[Vector, Vector]:  # pragma: no cover
    """Return the finger frame for a frame of the last joint, base frame.

    Args:
        arm: Figures of the arm, from `figures`.
        rotation: Axes of the last joint's frame as columns, shape (3, 3).
        origin: Origin of that frame, shape (3,), m.

    Returns:
        Position of the finger centre, shape (3,), m; its axes as columns, shape (3, 3), x out of the hand, z along the
        closing axis.
    """
    finger = np.empty((3, 3))
    position = np.empty(3)
    reach, turn_cos, turn_sin = arm[REACH], arm[TURN_COS], arm[TURN_SIN]
    for k in range(3):
        position[k] = origin[k] + reach * rotation[k, 2]
        finger[k, 0] = rotation[k, 2]
        finger[k, 1] = rotation[k, 0] * turn_cos + rotation[k, 1] * turn_sin
        finger[k, 2] = -rotation[k, 0] * turn_sin + rotation[k, 1] * turn_cos
    return position, finger


@njit(cache=True)
def forward(arm: Vector, q: Vector) -> tuple[Vector, Vector, Vector, Vector]:  # pragma: no cover
    """Return the finger frame and the joints' axes, base frame.

    Args:
        arm: Figures of the arm, from `figures`.
        q: Joint positions, shape (7,), rad.

    Returns:
        Position of the finger centre, shape (3,), m; its axes as columns, shape (3, 3), x out of the
        hand, z along the closing axis; the joints' axes and origins, each shape (7, 3).
    """
    rotations, origins = links(arm, q)
    position, finger = finger_of(arm, rotations[6], origins[6])
    return position, finger, rotations[:, :, 2].copy(), origins


@njit(cache=True)
def solve(A: Vector, b: Vector) -> Vector:  # pragma: no cover
    """Solve a symmetric positive definite system in place, by Cholesky; A shape (n, n), b shape (n,); return b."""
    # A = L Lᵀ in A's lower triangle, then L y = b, then Lᵀ x = y.
    n = b.shape[0]
    for j in range(n):
        for k in range(j):
            A[j, j] -= A[j, k] * A[j, k]
        A[j, j] = math.sqrt(A[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k]
            A[i, j] /= A[j, j]
    for i in range(n):
        for k in range(i):
            b[i] -= A[i, k] * b[k]
        b[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= A[k, i] * b[k]
        b[i] /= A[i, i]
    return b


@njit(cache=True)
def torque(
    arm: Vector, words: Vector, state: Vector, q: Vector, dq: Vector, now: float, period: float
) -> Vector:  # pragma: no cover
    """Return the joint torques of one control step, within the arm's limits of torque and torque rate.

    The arm's own controller adds the torques of gravity and friction. The law omits Coriolis torques: at 0.25 m/s, the largest
    speed of a transfer, they are below 0.6 N·m, or 2 N at the tip, and including them made no path straighter.

    Args:
        arm: Figures of the arm, from `figures`.
        words: The held setpoint, from `pack`; when its validity ends, the arm holds still at its pose at that time.
        state: State of the law, shape (STATE_WORDS,), updated.
        q: Joint positions, shape (7,), rad.
        dq: Joint velocities, shape (7,), rad/s.
        now: Time on the cell's clock, s.
        period: Period of the control loop, s.

    Returns:
        Torques, shape (7,), N·m.
    """
    rotations, origins = links(arm, q)
    is_valid = now <= words[VALID_UNTIL]
    if is_valid:
        wished = _steered(arm, words, state, rotations, origins, q, dq, now, period)
    else:
        wished = _held(arm, state, rotations, origins, q, dq, now)
    is_free = is_valid and words[IS_FREE] > 0.0
    tau: Vector = _bounded(arm, state, wished, rotations, origins, dq, period, is_free)
    return tau


@njit(cache=True, inline="always")
def _steered(  # noqa: C901, PLR0915  one law, whose blocks share its arrays
    arm: Vector,
    words: Vector,
    state: Vector,
    rotations: Vector,
    origins: Vector,
    q: Vector,
    dq: Vector,
    now: float,
    period: float,
) -> Vector:  # pragma: no cover
    """Return the torques of the law of Eq. (5)-(6), shape (7,), N·m, before the limits."""
    state[IS_HOLDING] = 0.0
    position, finger = finger_of(arm, rotations[6], origins[6])
    x, v = np.empty(3), np.empty(3)
    if words[HAS_HAND] > 0.0:
        c, s, length = math.cos(words[THETA]), math.sin(words[THETA]), words[LENGTH]
    else:
        c, s, length = 1.0, 0.0, 0.0
    # v = -(cos θ · f_x + sin θ · f_y),  x_p = p - L v, with the finger frame's axes f; [gibbons], Eq. (3).
    for k in range(3):
        v[k] = -(finger[k, 0] * c + finger[k, 1] * s)
        x[k] = position[k] - length * v[k]

    if words[ID] != state[SEEN_ID]:
        state[SEEN_ID] = words[ID]
        state[DAMPED_SINCE] = -math.inf
        for k in range(3):
            state[INTEGRAL + k] = 0.0

    # Column i of J is (z_i x (x_p - o_i), z_i);  V = J dq.
    J = np.empty((6, 7))
    twist = np.zeros(6)
    for i in range(7):
        rx, ry, rz = x[0] - origins[i, 0], x[1] - origins[i, 1], x[2] - origins[i, 2]
        ax, ay, az = rotations[i, 0, 2], rotations[i, 1, 2], rotations[i, 2, 2]
        J[0, i], J[1, i], J[2, i] = ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx
        J[3, i], J[4, i], J[5, i] = ax, ay, az
        for k in range(6):
            twist[k] += J[k, i] * dq[i]

    # Orientation: turn = -e = φ (v x v*) / |v x v*|,  φ = atan2(|v x v*|, v·v*).
    turn = np.zeros(3)
    wx = v[1] * words[AXIS + 2] - v[2] * words[AXIS + 1]
    wy = v[2] * words[AXIS] - v[0] * words[AXIS + 2]
    wz = v[0] * words[AXIS + 1] - v[1] * words[AXIS]
    sine = math.sqrt(wx * wx + wy * wy + wz * wz)
    cosine = v[0] * words[AXIS] + v[1] * words[AXIS + 1] + v[2] * words[AXIS + 2]
    if sine > 1e-9:
        scale = math.atan2(sine, cosine) / sine
        turn[0], turn[1], turn[2] = wx * scale, wy * scale, wz * scale
    if words[HAS_ROLL] > 0.0:
        # Roll about v: g = r* - (v·r*) v,  turn += atan2(v·(z x g), z·g) v, with the closing axis z.
        along = v[0] * words[ROLL] + v[1] * words[ROLL + 1] + v[2] * words[ROLL + 2]
        gx, gy, gz = words[ROLL] - along * v[0], words[ROLL + 1] - along * v[1], words[ROLL + 2] - along * v[2]
        zx, zy, zz = finger[0, 2], finger[1, 2], finger[2, 2]
        up = v[0] * (zy * gz - zz * gy) + v[1] * (zz * gx - zx * gz) + v[2] * (zx * gy - zy * gx)
        roll = math.atan2(up, zx * gx + zy * gy + zz * gz)
        for k in range(3):
            turn[k] += roll * v[k]

    # F = K (x_p* - x_p),  I += K_I turn dt with |I| <= limit,  T = K_R turn + I.
    wrench = np.empty(6)
    for k in range(3):
        wrench[k] = words[STIFFNESS + k] * (words[TIP + k] - x[k])
        limit = words[INTEGRAL_LIMIT]
        state[INTEGRAL + k] = min(max(state[INTEGRAL + k] + words[INTEGRAL_GAIN] * turn[k] * period, -limit), limit)
        wrench[3 + k] = words[STIFFNESS + 3 + k] * turn[k] + state[INTEGRAL + k]
    if not now - state[DAMPED_SINCE] < DAMPING_PERIOD:
        state[DAMPED_SINCE] = now
        M = dynamics.joint_inertia(arm[MASSES:MOST_LEARNT], rotations, origins)
        D = dynamics.critical_damping(dynamics.inertia_at(M, J), words[STIFFNESS : STIFFNESS + 6])
        for k in range(6):
            for j in range(6):
                # D_kj = sqrt(ζ_k ζ_j) D_crit,kj.
                ratio = math.sqrt(words[DAMPING_RATIO + k] * words[DAMPING_RATIO + j])
                state[DAMPING + 6 * k + j] = ratio * D[k, j]
    for k in range(6):
        for j in range(6):
            wrench[k] -= state[DAMPING + 6 * k + j] * (twist[j] - words[TWIST + j])

    # Null space: n = k_n (q* - q) - d_n dq.  A = (J Jᵀ + 1e-4 I)⁻¹; Jᵀ A is J's damped pseudo-inverse.
    null = np.empty(7)
    for i in range(7):
        null[i] = -NULL_DAMPING * dq[i]
        if words[HAS_POSTURE] > 0.0:
            null[i] += NULL_STIFFNESS * (words[POSTURE + i] - q[i])
    A = np.empty((6, 6))
    for k in range(6):
        for j in range(6):
            A[k, j] = 1e-4 if k == j else 0.0
            for i in range(7):
                A[k, j] += J[k, i] * J[j, i]
    A = dynamics.inverse(A)
    # tau = Jᵀ (F - A J n) + n: the projection removes the part of n that acts on the tip.
    # dq* = Jᵀ A V*, the joint velocities of the setpoint's twist, give the sign of the friction that is fed forward.
    felt, wanted = np.zeros(6), np.zeros(6)
    for k in range(6):
        for i in range(7):
            felt[k] += J[k, i] * null[i]
    for k in range(6):
        for j in range(6):
            wrench[k] -= A[k, j] * felt[j]
            wanted[k] += A[k, j] * words[TWIST + j]
    wished = np.empty(7)
    for i in range(7):
        t, rate = null[i], 0.0
        for k in range(6):
            t += J[k, i] * wrench[k]
            rate += J[k, i] * wanted[k]
        wished[i] = t + learning.feed_forward(state[LEARNING:], i, rate)
    return wished


@njit(cache=True, inline="always")
def _held(
    arm: Vector, state: Vector, rotations: Vector, origins: Vector, q: Vector, dq: Vector, now: float
) -> Vector:  # pragma: no cover
    """Return the torques that hold the arm still at its initial pose, -M (r² (q - held) + 2 r dq), shape (7,), N·m.

    Stiffness and damping proportional to the inertia M give every mode one critically damped rate r. The delay of the torques
    bounds that rate. A spring at the tip would be too soft for the whole arm at the stiffness that the wrist permits.
    """
    if state[IS_HOLDING] == 0.0:
        state[IS_HOLDING] = 1.0
        state[WEIGHED_SINCE] = -math.inf
        for k in range(3):
            state[INTEGRAL + k] = 0.0
        for i in range(JOINTS):
            state[HELD + i] = q[i]
    if not now - state[WEIGHED_SINCE] < DAMPING_PERIOD:
        state[WEIGHED_SINCE] = now
        M = dynamics.joint_inertia(arm[MASSES:MOST_LEARNT], rotations, origins)
        for i in range(JOINTS):
            M[i, i] += min(learning.sure_rotor(state[LEARNING:], i), arm[MOST_LEARNT + i])
            for j in range(JOINTS):
                state[INERTIA + JOINTS * i + j] = M[i, j]
    # tau_i = feed-forward + sum_j M_ij r (r (held_j - q_j) - 2 dq_j).
    torques = np.empty(JOINTS)
    for i in range(JOINTS):
        torques[i] = learning.feed_forward(state[LEARNING:], i, 0.0)
        for j in range(JOINTS):
            back = HOLD_RATE * (state[HELD + j] - q[j]) - 2.0 * dq[j]
            torques[i] += state[INERTIA + JOINTS * i + j] * HOLD_RATE * back
    return torques


@njit(cache=True, inline="always")
def _bounded(
    arm: Vector,
    state: Vector,
    wished: Vector,
    rotations: Vector,
    origins: Vector,
    dq: Vector,
    period: float,
    is_free: bool,
) -> Vector:  # pragma: no cover
    """Return torques within the arm's limits of torque and torque rate, and update the learning."""
    known = state[LEARNING:]
    tau = np.empty(7)
    for i in range(7):
        # |tau - tau_last| <= rate dt,  |tau| <= tau_max.
        last, step, most = state[TORQUE + i], arm[TORQUE_RATE + i] * period, arm[TORQUE_MAX + i]
        t = min(max(wished[i], last - step), last + step)
        tau[i] = min(max(t, -most), most)
        state[TORQUE + i] = tau[i]
        known[learning.COMMANDED + i] += tau[i] / learning.CYCLES
    known[learning.COUNT] += 1.0
    if known[learning.COUNT] >= learning.CYCLES:
        M = dynamics.joint_inertia(arm[MASSES:MOST_LEARNT], rotations, origins)
        learning.observe(known, M, dq, learning.CYCLES * period, is_free)
    return tau
