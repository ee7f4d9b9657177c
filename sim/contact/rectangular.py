"""Exact contacts between a rectangular peg and plates with one rectangular hole; `sim.contact.cylinder` has the round ones.

Peg and solid are bounded by planes, so the number of possible contacts is finite: the corners of the peg's end against
plane, walls and floor, and the hole's four rim edges against the peg's edges. The hole's own corners are re-entrant and
cannot touch. A pair of edges is a contact if their common normal lies in the normal cone of the solid's edge and,
reversed, in that of the peg's. Slightly outside the cone, a face is nearly flush with an edge. The pair then represents
the end of their common line and only spreads the load.
"""

import math

import numpy as np

from drivers.compiled import njit
from sim.contact.table import (
    ABOVE,
    FEATURE_BAND,
    NEAR,
    NONE,
    PENETRATION,
    SAMPLE_BAND,
    SURFACE,
    meeting,
    peg_end,
    plate_at,
    plate_of,
    put,
)
from sim.world import native

BEYOND = 1e-3
"""Extension of a rim edge beyond its ends, m. An edge of the peg that crosses the extension is over solid plate and
must not be below it either. Without the extension, an edge of the peg that slides past a corner of the hole would meet
the next rim edge only after entering it: the crossing point moves by more than a tenth of a millimetre in a step."""


@njit(cache=True)
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def collide(model, data, buffer, geom_plate, geom_peg, margin):  # type: ignore[no-untyped-def]
    """Find every possible contact of the peg's end with the plate, and add it; see `sim.world.native.collide_by`.

    The plate's `hole` and `across` are half the hole's sides.
    """
    plate = plate_at(plate_of(model, geom_plate))
    size = native.array(model + native.MODEL_GEOM_SIZE, (geom_peg + 1, 3))[geom_peg]
    half, depth = (plate.hole, plate.across), plate.depth
    e1, e2, v, c, g = peg_end(data, geom_plate, geom_peg, size[2])
    highest = size[0] * abs(e1[2]) + size[1] * abs(e2[2])
    if plate.mode == NONE or c[2] - highest > ABOVE:
        return 0
    away = math.sqrt(_dot(c, c))
    lever = max(size[0] + size[1], away + math.hypot(half[0] + BEYOND, half[1] + BEYOND) + NEAR)
    meet = meeting(model, data, geom_plate, geom_peg, g, lever)

    # Corners of the end: a point in the solid is below the plane and beyond a wall, so its clearance is the larger gap.
    corners = np.empty((4, 3))
    for n in range(4):
        s, t = size[0] * (1.0 if n in (0, 3) else -1.0), size[1] * (1.0 if n < 2 else -1.0)
        for k in range(3):
            corners[n, k] = c[k] + s * e1[k] + t * e2[k]
        p = (corners[n, 0], corners[n, 1], corners[n, 2])
        wall = min(half[0] - abs(p[0]), half[1] - abs(p[1]))
        if p[2] >= wall:
            put(meet, p[2], p, (0.0, 0.0, 1.0), SURFACE, FEATURE_BAND)
            continue
        for k in range(2):
            gap = half[k] - abs(p[k])
            if gap < NEAR:
                away = -1.0 if p[k] > 0.0 else 1.0
                inward = (away, 0.0, 0.0) if k == 0 else (0.0, away, 0.0)
                put(meet, gap, p, inward, PENETRATION, FEATURE_BAND)
        put(meet, p[2] + depth, p, (0.0, 0.0, 1.0), SURFACE, FEATURE_BAND)

    # Edges of the hole against edges of the peg: four around its end, four along it.
    for n in range(4):
        after = (n + 1) % 4
        # Faces on either side of the corner's own edge, and the face between it and the next corner's edge.
        before = _outward(e1, e2, n)
        between = _outward(e1, e2, after)
        start = (corners[n, 0], corners[n, 1], corners[n, 2])
        down = (-v[0], -v[1], -v[2])
        length = 2.0 * size[0] if n % 2 == 0 else 2.0 * size[1]
        round_end = (
            (corners[after, 0] - start[0]) / length,
            (corners[after, 1] - start[1]) / length,
            (corners[after, 2] - start[2]) / length,
        )
        _edges(meet, start, v, 2.0 * size[2], before, between)
        _edges(meet, start, round_end, length, between, down)
    return 0


@njit(cache=True, inline="always")
def _outward(e1, e2, n):  # type: ignore[no-untyped-def]
    """Return the outward normal of the side face that ends at corner n; corners start at (+, +) and continue to (-, +)."""
    side = e1 if n % 2 == 0 else e2
    sign = 1.0 if n < 2 else -1.0
    return (sign * side[0], sign * side[1], sign * side[2])


@njit(cache=True, inline="always")
def _least_way_out(start, along, length, inward, half):  # type: ignore[no-untyped-def]
    """Return the smallest displacement, m, up or into the bore, that moves an edge of the peg out of the solid.

    Only the solid behind one wall counts. If no part of the edge is inside it, the result is a large number. A contact
    along the common normal of two edges needs at most this displacement. If a normal needs more, the edge does not touch
    the rim: its end touches the surface beside the hole, or a wall below the rim.
    """
    fall, rise = start[2], along[2]
    wall, inwards = half + _dot(start, inward), _dot(along, inward)
    low, high = 0.0, length
    for value, slope in ((fall, rise), (wall, inwards)):
        if slope > 0.0:
            high = min(high, -value / slope)
        elif slope < 0.0:
            low = max(low, -value / slope)
        elif value >= 0.0:
            return BEYOND
    if low > high:
        return BEYOND
    up = -min(fall + low * rise, fall + high * rise)
    return min(up, -min(wall + low * inwards, wall + high * inwards))


@njit(cache=True)
def _edges(meet, start, along, length, one, other):  # type: ignore[no-untyped-def]
    """Add one edge of the peg, from `start` along a unit vector, against the hole's four; `one` and `other` are its faces' normals."""
    rounding = 1e-6  # Penetration below which a pair outside a cone is omitted, m.
    for k in range(4):
        sign = 1.0 if k < 2 else -1.0
        # Direction t of the rim edge; wall's normal into the bore; its distance from the axis; half the edge's length.
        if k % 2 == 0:
            t, inward, away, reach = (0.0, 1.0, 0.0), (-sign, 0.0, 0.0), meet.hole, meet.across
        else:
            t, inward, away, reach = (1.0, 0.0, 0.0), (0.0, -sign, 0.0), meet.across, meet.hole
        n = (
            t[1] * along[2] - t[2] * along[1],
            t[2] * along[0] - t[0] * along[2],
            t[0] * along[1] - t[1] * along[0],
        )
        sine = math.sqrt(_dot(n, n))
        # Sine of the angle below which two edges count as parallel and have no common normal. The contacts of their ends and
        # of the perpendicular edges then represent them.
        if sine < 1e-6:
            continue
        scale = 1.0 / sine if n[2] + _dot(n, inward) > 0.0 else -1.0 / sine
        n = (scale * n[0], scale * n[1], scale * n[2])
        inside = min(min(n[2], _dot(n, inward)), min(-_dot(n, one), -_dot(n, other)))
        # Sine of the largest angle of a normal outside a cone.
        if inside < -0.02:
            continue
        # Vector from the centre of the rim edge to the start of the peg's edge.
        d = (start[0] + away * inward[0], start[1] + away * inward[1], start[2])
        gap = _dot(d, n)
        if abs(gap) > NEAR or (inside < 0.0 and gap < -rounding):
            continue
        # Parameters of the two lines' closest points.
        cosine = _dot(t, along)
        across = 1.0 - cosine * cosine
        u = (cosine * _dot(d, t) - _dot(d, along)) / across
        s = _dot(d, t) + u * cosine
        if u < 0.0 or u > length or abs(s) > reach + BEYOND:
            continue
        if gap < 0.0 and -gap > _least_way_out(start, along, length, inward, away) + rounding:
            continue
        p = (start[0] + u * along[0], start[1] + u * along[1], start[2] + u * along[2])
        band = FEATURE_BAND if inside >= 0.0 else SAMPLE_BAND
        put(meet, gap, p, n, PENETRATION, band)
