"""Forward and inverse kinematics of an arm's links, hand and tip; pure numpy.

The torque loop has its own compiled kinematics, `drivers.impedance.forward`; these functions serve single calls.
"""

import math

import numpy as np

from drivers import frames
from drivers.arm.model import JOINTS, ArmModel
from drivers.quantities import Pose, Vector

_X, _Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
LONGEST_STEP = 0.2
"""Largest change of a joint in one iteration, rad."""


def links(arm: ArmModel, q: Vector) -> tuple[list[Vector], Vector]:
    """Return the links' axes as columns, each shape (3, 3), and their origins, shape (7, 3), m, base frame."""
    R, origin = np.eye(3), np.zeros(3)
    rotations, origins = [], np.zeros((JOINTS, 3))
    dh = arm.kinematics
    for i, (a, d, alpha, angle) in enumerate(zip(dh.a, dh.d, dh.alpha, q, strict=True)):
        leant = R @ frames.rotation_about(_X, alpha)
        origin = origin + a * R[:, 0] + d * leant[:, 2]
        R = leant @ frames.rotation_about(_Z, angle)
        rotations.append(R)
        origins[i] = origin
    return rotations, origins


def finger_frame(arm: ArmModel, q: Vector) -> Pose:
    """Return T_base_tcp, the finger frame: origin between the pads, x out of the hand, z along the closing axis."""
    rotations, origins = links(arm, q)
    flange = rotations[-1] @ frames.rotation_about(_Z, arm.hand.turn)
    centre = origins[-1] + (arm.kinematics.flange + arm.hand.finger_centre) * flange[:, 2]
    return Pose(centre, np.column_stack([flange[:, 2], flange[:, 0], flange[:, 1]]))


def jacobian(point: Vector, axes: Vector, origins: Vector, joints: int = JOINTS) -> Vector:
    """Return the Jacobian of a point that the first `joints` move, shape (6, 7), translation first, base frame.

    Args:
        point: Shape (3,), m.
        axes: Axes of the joints, shape (7, 3).
        origins: Points on those axes, shape (7, 3), m.
        joints: Number of joints, counted from the base, that move the point.
    """
    # Column i is (z_i x (p - o_i), z_i).
    J = np.zeros((6, JOINTS))
    J[:3, :joints] = np.cross(axes, point - origins)[:joints].T
    J[3:, :joints] = axes[:joints].T
    return J


def tip_jacobian(arm: ArmModel, q: Vector, length: float) -> Vector:
    """Return the Jacobian, shape (6, 7), of the end point of a peg that is straight in the hand and `length`, m, long."""
    rotations, origins = links(arm, q)
    axes = np.array([R[:, 2] for R in rotations])
    return jacobian(origins[-1] + (arm.kinematics.flange + arm.hand.finger_centre + length) * axes[-1], axes, origins)


def largest_push(arm: ArmModel, q: Vector, length: float) -> float:
    """Return the largest vertical force that the joints' torques can hold at a peg's end point, N, by tau = Jᵀ F.

    Args:
        arm: The arm.
        q: Joint positions, shape (7,), rad.
        length: Distance from the finger centre to the end point, m.
    """
    # F = min over joints of tau_max,i / |J_z,i|.
    levers = np.abs(tip_jacobian(arm, q, length)[2])
    return float(np.min(np.array(arm.joints.torque) / np.maximum(levers, 1e-9)))


def joints_at(arm: ArmModel, tip: Vector, axis: Vector, closing: Vector, length: float, elbow: float) -> Vector | None:
    """Return the joint positions that bring a peg to a goal; the peg is straight in the hand.

    The method is damped Newton from the arm's home, with the elbow's joint fixed and the joints kept within their limits.

    Args:
        arm: The arm.
        tip: Goal of the end point, shape (3,), m, base frame.
        axis: Goal of the peg's axis from its tip to the finger, unit, shape (3,), base frame.
        closing: Closing axis of the hand, unit, normal to `axis`, shape (3,), base frame.
        length: Distance from the finger centre to the end point, m.
        elbow: Position of the elbow's joint, rad.

    Returns:
        Shape (7,), rad; None if the arm cannot reach the goal.
    """
    wanted = np.column_stack([-axis, np.cross(closing, -axis), closing])
    low, high = np.array(arm.joints.q_min), np.array(arm.joints.q_max)
    moving = [i for i in range(JOINTS) if i != arm.kinematics.elbow - 1]
    q = np.array(arm.home)
    q[arm.kinematics.elbow - 1] = elbow
    # Largest number of iterations of the inverse kinematics.
    for _ in range(100):
        finger = finger_frame(arm, q)
        point = finger.position + length * finger.rotation[:, 0]
        error = np.concatenate([tip - point, _turn(wanted @ finger.rotation.T)])
        # Error below which the inverse kinematics has converged, m and rad.
        if float(np.abs(error).max()) < 1e-9:
            return q
        J = tip_jacobian(arm, q, length)[:, moving]
        # dq = (JᵀJ + λI)⁻¹ Jᵀ e, scaled to `LONGEST_STEP`.
        # Damping of the least-squares step; it keeps the step finite at a singular pose.
        step = np.linalg.solve(J.T @ J + 1e-6 * np.eye(len(moving)), J.T @ error)
        step *= min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), 1e-12))
        q[moving] = np.clip(q[moving] + step, low[moving], high[moving])
    return None


def _turn(R: Vector) -> Vector:
    """Return the rotation vector of a rotation matrix, shape (3,), rad."""
    # The quaternion is (cos φ/2, u sin φ/2); the result is φ u.
    w, *vector = frames.quaternion(R)
    sine = float(np.linalg.norm(vector))
    return np.array(vector) * (2.0 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0)
