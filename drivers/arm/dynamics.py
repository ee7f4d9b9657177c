"""An arm's inertia inside the torque loop, and the critical damping for it; pure and compiled.

The law calls these functions a hundred times a second. `drivers.arm.inertia` does the same for single calls in plain numpy.
"""

import math

import numpy as np

from drivers import frames
from drivers.arm.inertia import SLACK
from drivers.arm.model import JOINTS, ArmModel
from drivers.compiled import njit
from drivers.quantities import Vector

BODY = 10
"""Number of words for one body, in the frame of its joint: mass, kg; centre of mass, m; inertia about the centre of mass,
xx, yy, zz, xy, xz, yz, kg·m².
"""
ROTORS = BODY * JOINTS
WORDS = ROTORS + JOINTS
"""Number of words for an arm: seven bodies, the last with the hand, then the rotors' inertias, kg·m²."""


def masses(arm: ArmModel) -> Vector:
    """Return an arm's masses as the words of the compiled functions, shape (WORDS,)."""
    hand, turn = arm.hand, frames.rotation_about(np.array([0.0, 0.0, 1.0]), arm.hand.turn)
    bodies = [(link.mass, np.array(link.com), link.tensor()) for link in arm.link]
    # The fingers are point masses at the hand's centre of mass, as in `drivers.arm.inertia`.
    at = turn @ np.array(hand.body.com) + np.array([0.0, 0.0, arm.kinematics.flange])
    bodies[-1] = _joined(bodies[-1], (hand.body.mass + 2.0 * hand.finger.mass, at, turn @ hand.body.tensor() @ turn.T))
    words = [(mass, *com, *np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2]) for mass, com, tensor in bodies]
    return np.concatenate([*words, arm.joints.rotor_inertia])


def _joined(one: tuple[float, Vector, Vector], other: tuple[float, Vector, Vector]) -> tuple[float, Vector, Vector]:
    """Return two bodies as one: mass, centre of mass and inertia about it, shape (3, 3)."""
    mass = one[0] + other[0]
    com: Vector = (one[0] * one[1] + other[0] * other[1]) / mass
    tensor = np.zeros((3, 3))
    for part, at, own in (one, other):
        way = at - com
        tensor += own + part * (float(way @ way) * np.eye(3) - np.outer(way, way))
    return mass, com, tensor


@njit(cache=True)
def joint_inertia(masses: Vector, rotations: Vector, origins: Vector) -> Vector:  # pragma: no cover
    """Return the mass matrix of the arm with an empty hand, rotors included, shape (7, 7), kg·m².

    Args:
        masses: Words of the arm, from `masses`.
        rotations: Axes of the joints' frames as columns, shape (7, 3, 3), base frame.
        origins: Origins of those frames, shape (7, 3), m, base frame.
    """
    # M = sum over bodies of m Jvᵀ Jv + Jωᵀ (R I Rᵀ) Jω, plus the rotors' inertias on the diagonal;
    # column i of Jv is z_i x (com - o_i), column i of Jω is z_i.
    M = np.zeros((JOINTS, JOINTS))
    com, moved, turned = np.empty(3), np.empty((JOINTS, 3)), np.empty((JOINTS, 3))
    for body in range(JOINTS):
        words, R = masses[BODY * body : BODY * (body + 1)], rotations[body]
        for k in range(3):
            com[k] = origins[body, k] + R[k, 0] * words[1] + R[k, 1] * words[2] + R[k, 2] * words[3]
        tensor = congruence(R, _tensor(words))
        for i in range(body + 1):
            ax, ay, az = rotations[i, 0, 2], rotations[i, 1, 2], rotations[i, 2, 2]
            rx, ry, rz = com[0] - origins[i, 0], com[1] - origins[i, 1], com[2] - origins[i, 2]
            moved[i, 0], moved[i, 1], moved[i, 2] = ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx
            for k in range(3):
                turned[i, k] = tensor[k, 0] * ax + tensor[k, 1] * ay + tensor[k, 2] * az
        for i in range(body + 1):
            for j in range(body + 1):
                for k in range(3):
                    M[i, j] += words[0] * moved[i, k] * moved[j, k] + rotations[i, k, 2] * turned[j, k]
    for i in range(JOINTS):
        M[i, i] += masses[ROTORS + i]
    return M


@njit(cache=True, inline="always")
def _tensor(words: Vector) -> Vector:  # pragma: no cover
    """Return a body's inertia about its centre of mass, shape (3, 3), kg·m², from its words."""
    xx, yy, zz, xy, xz, yz = words[4], words[5], words[6], words[7], words[8], words[9]
    tensor = np.empty((3, 3))
    tensor[0, 0], tensor[0, 1], tensor[0, 2] = xx, xy, xz
    tensor[1, 0], tensor[1, 1], tensor[1, 2] = xy, yy, yz
    tensor[2, 0], tensor[2, 1], tensor[2, 2] = xz, yz, zz
    return tensor


@njit(cache=True)
def congruence(A: Vector, B: Vector) -> Vector:  # pragma: no cover
    """Return A B Aᵀ, shape (m, m), of A, shape (m, n), and B, shape (n, n); numba's own matrix product requires BLAS."""
    m, n = A.shape
    AB, C = np.zeros((m, n)), np.zeros((m, m))
    for i in range(m):
        for j in range(n):
            for k in range(n):
                AB[i, j] += A[i, k] * B[k, j]
        for j in range(m):
            for k in range(n):
                C[i, j] += AB[i, k] * A[j, k]
    return C


@njit(cache=True)
def inverse(A: Vector) -> Vector:  # pragma: no cover
    """Return the inverse of a symmetric positive definite matrix, shape (n, n), by Gauss-Jordan elimination."""
    B = A.copy()
    n = B.shape[0]
    for i in range(n):
        pivot = 1.0 / B[i, i]
        B[i, i] = 1.0
        for j in range(n):
            B[i, j] *= pivot
        for k in range(n):
            if k != i:
                factor = B[k, i]
                B[k, i] = 0.0
                for j in range(n):
                    B[k, j] -= factor * B[i, j]
    return B


@njit(cache=True, inline="always")
def geometric_mean(A: Vector, B: Vector) -> Vector:  # pragma: no cover
    """Return the geometric mean of two symmetric positive definite matrices, each shape (n, n).

    The mean is the matrix G with G A⁻¹ G = B. The arithmetic mean (A + B)/2 and the harmonic mean 2 (A⁻¹ + B⁻¹)⁻¹,
    iterated, both converge to G.
    """
    n = A.shape[0]
    high, low = A.copy(), B.copy()
    # Largest number of iterations for the mean of two matrices; six usually suffice.
    for _ in range(20):
        a, b = inverse(high), inverse(low)
        for i in range(n):
            for j in range(n):
                high[i, j] = 0.5 * (high[i, j] + low[i, j])
                a[i, j] = 0.5 * (a[i, j] + b[i, j])
        low = inverse(a)
        apart = 0.0
        for i in range(n):
            apart = max(apart, abs(high[i, i] - low[i, i]) / high[i, i])
        # Relative difference of the two means below which they count as equal.
        if apart < 1e-6:
            break
    mean = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            mean[i, j] = 0.5 * (0.5 * (high[i, j] + low[i, j]) + 0.5 * (high[j, i] + low[j, i]))
    return mean


@njit(cache=True, inline="always")
def inertia_at(M: Vector, J: Vector) -> Vector:  # pragma: no cover
    """Return the inertia of the arm at a point of the hand, (J M⁻¹ Jᵀ)⁻¹, shape (6, 6), base frame: kg, kg·m and kg·m².

    Args:
        M: Mass matrix, shape (7, 7), kg·m².
        J: Jacobian of the point, shape (6, 7), base frame.
    """
    mobility = congruence(J, inverse(M))
    for k in range(mobility.shape[0]):
        # Mobility added along every direction, 1/kg and 1/(kg·m²): it keeps the inertia of an outstretched arm finite.
        mobility[k, k] += 1e-12
    L: Vector = inverse(mobility)
    return L


@njit(cache=True, inline="always")
def critical_damping(L: Vector, stiffness: Vector) -> Vector:  # pragma: no cover
    """Return the damping that damps every mode of an inertia on springs critically, shape (6, 6).

    With D = 2 (L # K), L x'' + D x' + K x = 0 decouples into critically damped modes; # is the geometric mean.
    This is the double diagonalisation of [albu] for one damping ratio.

    Args:
        L: Inertia, shape (6, 6).
        stiffness: K's diagonal, shape (6,), N/m and N·m/rad; smaller values count as `SLACK`.
    """
    K = np.zeros((6, 6))
    scale = 0.0
    for k in range(6):
        K[k, k] = max(stiffness[k], SLACK)
        scale += math.log(K[k, k] / L[k, k]) / 6.0
    # Scaling L by s to the size of K saves iterations; (s L) # K = sqrt(s) (L # K).
    scale = math.exp(scale)
    scaled = np.empty((6, 6))
    for k in range(6):
        for j in range(6):
            scaled[k, j] = scale * L[k, j]
    D: Vector = geometric_mean(scaled, K)
    for k in range(6):
        for j in range(6):
            D[k, j] *= 2.0 / math.sqrt(scale)
    return D
