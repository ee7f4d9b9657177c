"""Exact contacts between a square peg and plates with one square hole, beside `sim.contact`, which has the round ones.

Peg and solid are bounded by planes, so the places where they can touch are finite in number: the corners of the peg's
end against plane, walls and floor, and the hole's four rim edges against the peg's edges. The hole's own corners are
re-entrant and touch nothing. A pair of edges counts where the normal of both lies in the cone of normals of the solid's
edge and, turned round, of the peg's; a little outside of it, where a face is nearly flush with an edge, it stands for
the end of their common line and only spreads the load.
"""

import math

import mujoco
import numpy as np
from numba import carray, types

from drivers.compiled import cfunc, njit
from sim import native
from sim.contact import FEATURE_BAND, NEAR, NONE, PLATE_TYPE, SAMPLE_BAND, USER, put

PEG_TYPE = mujoco.mjtGeom.mjGEOM_BOX
"""Against `PLATE_TYPE` again a pair that nothing else uses; the plate's `geom_user` has half the hole's side for its radius."""

FLUSH = 0.02
"""Sine of the angle by which a normal may lie outside of a cone."""
ROUNDING = 1e-6
"""Outside of the cone a pair that is closer than touching, m, is not what touches."""
PARALLEL = 1e-6
"""Sine of the angle below which two edges have no common normal; their ends and the edges across then stand for them."""
BEYOND = 5e-5
"""A rim edge counts so far beyond its ends, m: there its plane and wall go on inside the solid, and no peg's edge may be."""


@njit(cache=True)
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def collide(model, data, geom_plate, geom_peg):  # type: ignore[no-untyped-def]
    """Find every place where the end of the peg may touch the plate, and add it as a contact."""
    last = max(geom_plate, geom_peg) + 1
    user = carray(native.pointer(native.load(model + native.MODEL_GEOM_USER)), (last, USER), np.float64)[geom_plate]
    xpos = carray(native.pointer(native.load(data + native.DATA_GEOM_XPOS)), (last, 3), np.float64)
    xmat = carray(native.pointer(native.load(data + native.DATA_GEOM_XMAT)), (last, 3, 3), np.float64)
    size = carray(native.pointer(native.load(model + native.MODEL_GEOM_SIZE)), (last, 3), np.float64)[geom_peg]
    origin, R, A, middle = xpos[geom_plate], xmat[geom_plate], xmat[geom_peg], xpos[geom_peg]
    half, hole, depth = size[2], user[0], user[1]
    # The peg's end frame in the plate's frame: c the middle of the end face, E's columns the peg's axes, z away from it.
    E, c = np.zeros((3, 3)), np.zeros(3)
    for i in range(3):
        for k in range(3):
            c[i] += R[k, i] * (middle[k] - half * A[k, 2] - origin[k])
            for j in range(3):
                E[i, j] += R[k, i] * A[k, j]
    highest = size[0] * abs(E[2, 0]) + size[1] * abs(E[2, 1])
    if user[6] == NONE or c[2] - highest > 2e-3:
        return

    body = carray(native.pointer(native.load(model + native.MODEL_GEOM_BODYID)), (last,), np.int32)[geom_peg]
    root = carray(native.pointer(native.load(model + native.MODEL_BODY_ROOTID)), (body + 1,), np.int32)[body]
    cvel = carray(native.pointer(native.load(data + native.DATA_CVEL)), (body + 1, 6), np.float64)[body]
    com = carray(native.pointer(native.load(data + native.DATA_SUBTREE_COM)), (body + 1, 3), np.float64)[root]
    twist = ((com[0], com[1], com[2]), (cvel[0], cvel[1], cvel[2]), (cvel[3], cvel[4], cvel[5]), math.inf)
    address = native.load(data + native.DATA_USERDATA)
    scratch = carray(native.pointer(address), (native.NUSERDATA,), np.float64)
    ids = carray(native.pointer(address + 8 * native.CONTACT_WORDS), (14,), np.int32)
    ids[1] = ids[3] = geom_plate
    ids[2] = ids[4] = geom_peg
    frame = (origin, R)

    # The end's corners: a point in the solid is below the plane and beyond a wall, so its clearance is the larger gap.
    corners = np.empty((4, 3))
    for n in range(4):
        s, t = size[0] * (1.0 if n in (0, 3) else -1.0), size[1] * (1.0 if n < 2 else -1.0)
        for k in range(3):
            corners[n, k] = c[k] + s * E[k, 0] + t * E[k, 1]
        p = (corners[n, 0], corners[n, 1], corners[n, 2])
        wall = hole - max(abs(p[0]), abs(p[1]))
        if p[2] >= wall:
            put(model, data, scratch, ids, frame, twist, user, p[2], p, (0.0, 0.0, 1.0), False, FEATURE_BAND)
            continue
        for k in range(2):
            gap = hole - abs(p[k])
            if gap < NEAR:
                away = -1.0 if p[k] > 0.0 else 1.0
                inward = (away, 0.0, 0.0) if k == 0 else (0.0, away, 0.0)
                put(model, data, scratch, ids, frame, twist, user, gap, p, inward, True, FEATURE_BAND)
        put(model, data, scratch, ids, frame, twist, user, p[2] + depth, p, (0.0, 0.0, 1.0), False, FEATURE_BAND)

    # The hole's edges against the peg's: four round its end, four along it.
    for n in range(4):
        after = (n + 1) % 4
        # The faces on either side of the corner's own edge, and the one between it and the next corner's.
        before = _outward(E, n)
        between = _outward(E, after)
        start = (corners[n, 0], corners[n, 1], corners[n, 2])
        along = (E[0, 2], E[1, 2], E[2, 2])
        down = (-along[0], -along[1], -along[2])
        length = 2.0 * size[0] if n % 2 == 0 else 2.0 * size[1]
        round_end = (
            (corners[after, 0] - start[0]) / length,
            (corners[after, 1] - start[1]) / length,
            (corners[after, 2] - start[2]) / length,
        )
        _edges(model, data, scratch, ids, frame, twist, user, start, along, 2.0 * half, before, between, False)
        _edges(model, data, scratch, ids, frame, twist, user, start, round_end, length, between, down, True)


@njit(cache=True)
def _outward(E, n):  # type: ignore[no-untyped-def]
    """Return the outward normal of the side face that ends at corner n; corners go round from (+, +) by way of (-, +)."""
    k = 0 if n % 2 == 0 else 1
    sign = 1.0 if n < 2 else -1.0
    return (sign * E[0, k], sign * E[1, k], sign * E[2, k])


@njit(cache=True)
def _depth(p, inward, hole):  # type: ignore[no-untyped-def]
    """Return how little a corner within the solid behind one wall is in it, m, not above 0; far below 0 for one that is not.

    Where the corner is in the solid less deep than its edge passes below the rim, the corner is what touches.
    """
    wall = hole + _dot(p, inward)
    return max(p[2], wall) if p[2] < 0.0 and wall < 0.0 else -1.0


@njit(cache=True)
def _edges(model, data, scratch, ids, frame, twist, user, start, along, length, one, other, is_end):  # type: ignore[no-untyped-def]
    """Add one edge of the peg, from `start` along a unit vector, against the hole's four; one and other its faces' normals."""
    hole = user[0]
    end = (start[0] + length * along[0], start[1] + length * along[1], start[2] + length * along[2])
    for k in range(4):
        sign = 1.0 if k < 2 else -1.0
        # The rim edge's direction t and the wall's normal into the bore.
        if k % 2 == 0:
            t, inward = (0.0, 1.0, 0.0), (-sign, 0.0, 0.0)
        else:
            t, inward = (1.0, 0.0, 0.0), (0.0, -sign, 0.0)
        n = (
            t[1] * along[2] - t[2] * along[1],
            t[2] * along[0] - t[0] * along[2],
            t[0] * along[1] - t[1] * along[0],
        )
        sine = math.sqrt(_dot(n, n))
        if sine < PARALLEL:
            continue
        scale = 1.0 / sine if n[2] + _dot(n, inward) > 0.0 else -1.0 / sine
        n = (scale * n[0], scale * n[1], scale * n[2])
        inside = min(min(n[2], _dot(n, inward)), min(-_dot(n, one), -_dot(n, other)))
        if inside < -FLUSH:
            continue
        # From the middle of the rim edge to the start of the peg's.
        d = (start[0] + hole * inward[0], start[1] + hole * inward[1], start[2])
        gap = _dot(d, n)
        if abs(gap) > NEAR or (inside < 0.0 and gap < -ROUNDING):
            continue
        # Where the two lines are closest, along either.
        cosine = _dot(t, along)
        across = 1.0 - cosine * cosine
        u = (cosine * _dot(d, t) - _dot(d, along)) / across
        s = _dot(d, t) + u * cosine
        if u < 0.0 or u > length or abs(s) > hole + BEYOND:
            continue
        if gap < 0.0 and is_end and max(_depth(start, inward, hole), _depth(end, inward, hole)) > gap:
            continue
        p = (start[0] + u * along[0], start[1] + u * along[1], start[2] + u * along[2])
        band = FEATURE_BAND if inside >= 0.0 else SAMPLE_BAND
        put(model, data, scratch, ids, frame, twist, user, gap, p, n, True, band)


@cfunc(types.int32(types.intp, types.intp, types.intp, types.int32, types.int32, types.float64), cache=True)
def _hook(model, data, buffer, geom_plate, geom_peg, margin):  # type: ignore[no-untyped-def]
    collide(model, data, geom_plate, geom_peg)
    return 0


def install() -> None:
    """Put these contacts into this process's collision table; harmless when repeated."""
    native.collide_by(PLATE_TYPE, PEG_TYPE, _hook.address)
