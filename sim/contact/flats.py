"""A hole of eight tangent boxes that rotate with the peg, each at the peg's nearest point to the wall.

Every half-plane beyond a tangent of the hole is solid plate. Flats that move each step can therefore only omit
material, never add any. Each sector is fixed to the peg's tilt azimuth and keeps one flat, so that no flat jumps to
another's position.
"""

import math

import numpy as np

from drivers.compiled import njit

FLATS = 8
FLAT_SIZE = (0.05, 0.11, 0.02)
"""Half sizes of a box: away from the hole, along the tangent, and down, m."""
SECTOR = 2.0 * math.pi / FLATS
"""Angle between two boxes without contact, rad."""
SAMPLES = 192
"""Number of samples of the peg's rim; the error of the nearest point is less than 1 um."""
REACH = 1e-4
"""Height above the surface up to which points of the rim are used, m."""

_COS = np.cos(2.0 * math.pi / SAMPLES * np.arange(SAMPLES))
_SIN = np.sin(2.0 * math.pi / SAMPLES * np.arange(SAMPLES))


@njit(cache=True, inline="always")
def aim(end, hole, origin, R, xpos, xmat):  # type: ignore[no-untyped-def]
    """Rotate the boxes to the points of the peg that are furthest from the hole's axis, projected on the surface.

    Only the part of the peg below the surface is used.

    Args:
        end: The end of the peg in the plate's frame, see `sim.contact.cylinder.End`.
        hole: Radius of the hole, m.
        origin: Place of the plate in the world, m.
        R: Axes of the plate as columns.
        xpos: Places of the boxes, shape (FLATS, 3), m, written.
        xmat: Axes of the boxes, shape (FLATS, 3, 3), written.
    """
    c, e1, e2, v, r = end.c, end.e1, end.e2, end.v, end.r
    tilt = math.sqrt(v[0] * v[0] + v[1] * v[1])
    ax, ay = (v[0] / tilt, v[1] / tilt) if tilt > 1e-6 else (1.0, 0.0)
    furthest, lowest = np.zeros(FLATS), np.full(FLATS, REACH)
    U = np.empty((FLATS, 2))
    for k in range(FLATS):
        # A sector without a point of the peg keeps its flat in its centre.
        cosine, sine = math.cos(SECTOR * k), math.sin(SECTOR * k)
        U[k, 0], U[k, 1] = ax * cosine - ay * sine, ay * cosine + ax * sine
    for i in range(SAMPLES):
        pz = c[2] + r * (_COS[i] * e1[2] + _SIN[i] * e2[2])
        if pz > REACH:
            continue
        px = c[0] + r * (_COS[i] * e1[0] + _SIN[i] * e2[0])
        py = c[1] + r * (_COS[i] * e1[1] + _SIN[i] * e2[1])
        up = -pz / v[2] if pz < 0.0 else 0.0
        for _ in range(2):
            square = px * px + py * py
            angle = math.atan2(py * ax - px * ay, px * ax + py * ay)
            k = math.floor(angle / SECTOR + 0.5) % FLATS
            # If points are below the surface, the outermost of them is used; otherwise the lowest point.
            is_first = square > furthest[k] if pz < 0.0 else pz < lowest[k]
            if is_first:
                lowest[k] = pz
                furthest[k] = square if pz < 0.0 else 0.0
                distance = math.sqrt(square)
                U[k, 0], U[k, 1] = px / distance, py / distance
            # Then the same line of the peg's side at its exit from the surface.
            px, py = px + v[0] * up, py + v[1] * up
    w, _, h = FLAT_SIZE
    for k in range(FLATS):
        x, y = U[k, 0], U[k, 1]
        for i in range(3):
            xpos[k, i] = origin[i] + (hole + w) * (R[i, 0] * x + R[i, 1] * y) - h * R[i, 2]
            xmat[k, i, 0] = R[i, 0] * x + R[i, 1] * y
            xmat[k, i, 1] = R[i, 1] * x - R[i, 0] * y
            xmat[k, i, 2] = R[i, 2]
