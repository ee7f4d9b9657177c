"""The arm's inertia as it is felt at the peg's tip: from the links' masses alone, without the physics; pure."""

import numpy as np

from drivers import frames, panda
from drivers.quantities import Vector
from sim import panda_inertia

_X, _Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def tip_inertia(q: Vector, length: float) -> Vector:
    """Return the inertia of the arm at the end point of a peg that sits straight in the hand, (J M⁻¹ Jᵀ)⁻¹.

    Args:
        q: Joint positions, shape (7,), rad.
        length: From the finger centre to the end point, m.

    Returns:
        Shape (6, 6), translation first, base frame: kg, kg·m and kg·m².
    """
    rotations, origins = _links(q)
    axes = np.array([R[:, 2] for R in rotations])
    tip = origins[6] + (panda.FLANGE_D + panda.FINGER_CENTRE + length) * axes[6]
    J = _jacobian(tip, axes, origins, panda.JOINTS)
    return np.linalg.inv(J @ np.linalg.inv(joint_inertia(q)) @ J.T).astype(np.float64)


def joint_inertia(q: Vector) -> Vector:
    """Return the mass matrix of the arm with an empty hand, shape (7, 7), kg·m²."""
    rotations, origins = _links(q)
    axes = np.array([R[:, 2] for R in rotations])
    M = np.zeros((panda.JOINTS, panda.JOINTS))
    for i, (R, (mass, com, (xx, yy, zz, xy, xz, yz))) in enumerate(zip(rotations, panda_inertia.LINKS, strict=True)):
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        M += _body(mass, origins[i] + R @ com, R @ inertia @ R.T, axes, origins, i + 1)
    hand = rotations[6] @ frames.rotation_about(_Z, panda.HAND_TURN)
    com = origins[6] + panda.FLANGE_D * axes[6] + hand @ panda_inertia.HAND_COM
    inertia = hand @ np.diag(panda_inertia.HAND_INERTIA) @ hand.T
    mass = panda_inertia.HAND_MASS + 2 * panda_inertia.FINGER_MASS
    M += _body(mass, com, inertia, axes, origins, panda.JOINTS)
    return M


def _links(q: Vector) -> tuple[list[Vector], Vector]:
    """Return the links' axes as columns and their origins, base frame; Craig's convention, as in `drivers.panda`."""
    R, origin = np.eye(3), np.zeros(3)
    rotations, origins = [], np.zeros((panda.JOINTS, 3))
    for i, (a, d, alpha, angle) in enumerate(zip(panda.DH_A, panda.DH_D, panda.DH_ALPHA, q, strict=True)):
        leant = R @ frames.rotation_about(_X, alpha)
        origin = origin + a * R[:, 0] + d * leant[:, 2]
        R = leant @ frames.rotation_about(_Z, angle)
        rotations.append(R)
        origins[i] = origin
    return rotations, origins


def _body(mass: float, com: Vector, inertia: Vector, axes: Vector, origins: Vector, joints: int) -> Vector:
    """Return what one body, moved by the first `joints`, adds to the mass matrix; inertia about its com, base frame."""
    J = _jacobian(com, axes, origins, joints)
    M: Vector = mass * J[:3].T @ J[:3] + J[3:].T @ inertia @ J[3:]
    return M


def _jacobian(point: Vector, axes: Vector, origins: Vector, joints: int) -> Vector:
    J = np.zeros((6, panda.JOINTS))
    J[:3, :joints] = np.cross(axes, point - origins)[:joints].T
    J[3:, :joints] = axes[:joints].T
    return J
