"""Composition, inversion and conversion of frames and rotations; pure functions."""

import math
from collections.abc import Sequence

import numpy as np

from drivers.quantities import Pose, Vector

UP: Vector = np.array([0.0, 0.0, 1.0])
_ONE = np.eye(3)


def compose(T_a_b: Pose, T_b_c: Pose) -> Pose:
    """Return T_a_c, the composition of T_a_b and T_b_c."""
    return Pose(T_a_b.position + T_a_b.rotation @ T_b_c.position, T_a_b.rotation @ T_b_c.rotation)


def peg_in_finger(theta: float, length: float) -> Pose:
    """Return T_tcp_peg, the pose of the peg's end point in the finger frame.

    [gibbons], Eq. (2), corrected: the printed matrix is not a rigid transform. Here the origin is
    length·(cos t, sin t, 0). The third column is v = -(cos t, sin t, 0), the peg's axis from the tip to the finger:
    v* = (0, 0, 1) in the base frame means upright. The first column is the closing axis; the second completes a
    right-handed frame.

    Args:
        theta: In-hand angle about the closing axis, rad.
        length: Distance from the finger centre to the end point, m.
    """
    c, s = math.cos(theta), math.sin(theta)
    rotation = np.array([[0.0, -s, -c], [0.0, c, -s], [1.0, 0.0, 0.0]])
    return Pose(np.array([length * c, length * s, 0.0]), rotation)


def angle_between(a: Sequence[float] | Vector, b: Sequence[float] | Vector) -> float:
    """Return the angle between two vectors, rad, in [0, pi]; also exact if they are nearly parallel.

    The formula is atan2(|a × b|, a · b); arccos loses its precision for nearly parallel vectors.
    """
    cross = math.hypot(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    return math.atan2(cross, float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]))


def cross(a: Vector, b: Vector) -> Vector:
    """Return the cross product of two vectors, shape (3,); `numpy.cross` takes ten times as long for a single pair."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def rotation_about(axis: Vector, angle: float) -> Vector:
    """Return the rotation by `angle`, rad, about the unit vector `axis`, shape (3, 3) (Rodrigues)."""
    x, y, z = axis.tolist()
    c, s = math.cos(angle), math.sin(angle)
    # R = cos φ I + sin φ K + (1 - cos φ) a aᵀ; sums of arrays would take four times as long.
    u, v, w = (1.0 - c) * x, (1.0 - c) * y, (1.0 - c) * z
    return np.array(
        [
            [c + u * x, u * y - s * z, u * z + s * y],
            [v * x + s * z, c + v * y, v * z - s * x],
            [w * x - s * y, w * y + s * x, c + w * z],
        ]
    )


def quaternion(rotation: Vector) -> tuple[float, float, float, float]:
    """Return the unit quaternion, wxyz, w >= 0, of a rotation, shape (3, 3).

    The largest of the four components is computed first and divides the others, so that nothing cancels
    (Shepperd's method).
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.tolist()
    squares = (1.0 + xx + yy + zz, 1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz)
    products = (
        (squares[0], zy - yz, xz - zx, yx - xy),
        (zy - yz, squares[1], yx + xy, xz + zx),
        (xz - zx, yx + xy, squares[2], zy + yz),
        (yx - xy, xz + zx, zy + yz, squares[3]),
    )
    w, x, y, z = products[squares.index(max(squares))]
    scale = (1.0 if w >= 0.0 else -1.0) / math.sqrt(w * w + x * x + y * y + z * z)
    return w * scale, x * scale, y * scale, z * scale


def rotation_of(quaternion: Vector) -> Vector:
    """Return the rotation, shape (3, 3), of a unit quaternion, wxyz, shape (4,)."""
    w, x, y, z = quaternion
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # R = I + 2 w K + 2 K².
    rotation: Vector = _ONE + 2.0 * w * K + 2.0 * (K @ K)
    return rotation


def rotation_by(turn: Vector) -> Vector:
    """Return the rotation, shape (3, 3), of a rotation vector, rad."""
    angle = float(np.linalg.norm(turn))
    return rotation_about(turn / angle, angle) if angle > 0.0 else _ONE.copy()


def end_point(T_base_tcp: Pose, theta: float, length: float) -> tuple[Vector, Vector]:
    """Return the peg's end point x_p, m, and its axis v, both shape (3,) in the base frame, [gibbons], Eq. (3)."""
    c, s = math.cos(theta), math.sin(theta)
    # Plain floats take half the time of arrays with three elements.
    (xx, yx, _), (xy, yy, _), (xz, yz, _) = T_base_tcp.rotation.tolist()
    vx, vy, vz = -c * xx - s * yx, -c * xy - s * yy, -c * xz - s * yz
    x, y, z = T_base_tcp.position.tolist()
    both = np.array([x - length * vx, y - length * vy, z - length * vz, vx, vy, vz])
    return both[:3], both[3:]
