"""An arm's inertia at its joints and at the peg's tip, from the masses of its links; pure numpy."""

import numpy as np

from drivers import frames
from drivers.arm.kinematics import jacobian, links, tip_jacobian
from drivers.arm.model import JOINTS, ArmModel
from drivers.quantities import Vector

SLACK = 1e-3
"""Smallest stiffness for the computation of the damping, N/m and N·m/rad; smaller values count as this."""


def tip_inertia(arm: ArmModel, q: Vector, length: float) -> Vector:
    """Return the inertia of arm and rotors at the end point of a peg that is straight in the hand, (J M⁻¹ Jᵀ)⁻¹.

    Args:
        arm: The arm.
        q: Joint positions, shape (7,), rad.
        length: Distance from the finger centre to the end point, m.

    Returns:
        Shape (6, 6), translation first, base frame: kg, kg·m and kg·m².
    """
    J = tip_jacobian(arm, q, length)
    M = joint_inertia(arm, q) + np.diag(arm.joints.rotor_inertia)
    # L = (J M⁻¹ Jᵀ)⁻¹.
    return np.linalg.inv(J @ np.linalg.inv(M) @ J.T).astype(np.float64)


def critical_damping(L: Vector, stiffness: Vector) -> Vector:
    """Return the damping that damps every mode of an inertia on springs critically, shape (6, 6).

    The damping is D = 2 (L # K), the double diagonalisation of [albu], explained in `drivers.arm.dynamics`.

    Args:
        L: Inertia, shape (6, 6).
        stiffness: K's diagonal, shape (6,), N/m and N·m/rad; smaller values count as `SLACK`.
    """
    # L = C Cᵀ and C⁻¹ K C⁻ᵀ = Q Ω² Qᵀ, with the natural frequencies Ω of the modes; L # K = C Q Ω Qᵀ Cᵀ.
    C = np.linalg.cholesky(L)
    inward = np.linalg.inv(C)
    squares, Q = np.linalg.eigh(inward * np.maximum(stiffness, SLACK) @ inward.T)
    D: Vector = 2.0 * (C @ Q * np.sqrt(squares)) @ (C @ Q).T
    return D


def joint_inertia(arm: ArmModel, q: Vector) -> Vector:
    """Return the mass matrix of the links and the empty hand, shape (7, 7), kg·m².

    The fingers count as point masses at the hand's centre of mass, as in the simulation while it holds a peg.
    """
    rotations, origins = links(arm, q)
    axes = np.array([R[:, 2] for R in rotations])
    M = np.zeros((JOINTS, JOINTS))
    for i, (R, link) in enumerate(zip(rotations, arm.link, strict=True)):
        M += _body(link.mass, origins[i] + R @ link.com, R @ link.tensor() @ R.T, axes, origins, i + 1)
    turned = rotations[-1] @ frames.rotation_about(np.array([0.0, 0.0, 1.0]), arm.hand.turn)
    body = arm.hand.body
    com = origins[-1] + arm.kinematics.flange * axes[-1] + turned @ body.com
    mass = body.mass + 2 * arm.hand.finger.mass
    M += _body(mass, com, turned @ body.tensor() @ turned.T, axes, origins, JOINTS)
    return M


def _body(mass: float, com: Vector, inertia: Vector, axes: Vector, origins: Vector, joints: int) -> Vector:
    """Return one body's contribution to the mass matrix; the first `joints` move it; `inertia` about `com`, base frame."""
    # M = m Jvᵀ Jv + Jωᵀ I Jω.
    J = jacobian(com, axes, origins, joints)
    M: Vector = mass * J[:3].T @ J[:3] + J[3:].T @ inertia @ J[3:]
    return M
