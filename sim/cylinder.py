"""Exact contacts between a round peg and plates with one round hole.

The features of a cylinder against a half-space with a bore are found in closed form. The set of places where
the peg's end may touch is complete: every point of the peg's rim must stay out of the solid
{z < 0, rho > R}, so its clearance is g = max(z, R - rho), and every point of the hole's edge must stay
out of the peg's side. The local minima of g over the rim are rim on plane (z decides), rim on wall
(R - rho decides) and, where both are equal, edge on edge, whose normal is the convex combination of the
two that is perpendicular to the rim: the cross product of the two edges' tangents.

Nearly conformal surfaces (a flat peg on the plate, an aligned peg in the bore) touch along circles, for which fixed
samples of the peg's rim and of the hole's edge stand; samples that move with the tilt would flicker.
"""

import math
from typing import NamedTuple

import mujoco
import numpy as np
from numba import types

from drivers.compiled import cfunc, njit
from sim import flats, native
from sim.contact import (
    ABOVE,
    FEATURE_BAND,
    NEAR,
    NONE,
    PLATE_TYPE,
    SAMPLE_BAND,
    meeting,
    peg_end,
    plate_at,
    plate_of,
    put,
)

PEG_TYPE = mujoco.mjtGeom.mjGEOM_CYLINDER
"""Geom type of the peg; against `PLATE_TYPE` no other pair in the scene uses it."""
SCAN = 48
"""Number of points of the peg's rim, and of the hole's edge, that are scanned for minima."""
SAMPLE_EVERY = 3
"""Interval of the scanned points that are also contacts where surfaces are nearly conformal: every third."""
UP = (0.0, 0.0, 1.0)

_ANGLE = 2.0 * math.pi / SCAN
_COS = np.cos(_ANGLE * np.arange(SCAN))
_SIN = np.sin(_ANGLE * np.arange(SCAN))


class End(NamedTuple):
    """The end of a round peg in the plate's frame."""

    c: tuple[float, float, float]
    """Middle of the end face, m."""
    e1: tuple[float, float, float]
    """First axis in the end face."""
    e2: tuple[float, float, float]
    """Second axis in the end face."""
    v: tuple[float, float, float]
    """Axis of the peg, away from the end."""
    r: float
    """Radius, m."""
    tilt: float
    """Sine of the angle between the axes of peg and hole."""


@njit(cache=True)
def _rim(end, cosine, sine):  # type: ignore[no-untyped-def]
    """Return a point of the peg's rim and its derivative by the angle, plate frame."""
    c, e1, e2, r = end.c, end.e1, end.e2, end.r
    p = (
        c[0] + r * (cosine * e1[0] + sine * e2[0]),
        c[1] + r * (cosine * e1[1] + sine * e2[1]),
        c[2] + r * (cosine * e1[2] + sine * e2[2]),
    )
    dp = (
        r * (cosine * e2[0] - sine * e1[0]),
        r * (cosine * e2[1] - sine * e1[1]),
        r * (cosine * e2[2] - sine * e1[2]),
    )
    return p, dp


@njit(cache=True)
def _inward(p, rho):  # type: ignore[no-untyped-def]
    """Return the wall's normal at a point, into the bore; a point on the hole's axis touches no wall."""
    if rho < 1e-12:
        return (0.0, 0.0, 1.0)
    return (-p[0] / rho, -p[1] / rho, 0.0)


@njit(cache=True)
def collide(model, data, geom_plate, geom_peg):  # type: ignore[no-untyped-def]
    """Find every place where the end of the peg may touch the plate, and add it as a contact."""
    plate = plate_at(plate_of(model, geom_plate))
    size = native.array(model + native.MODEL_GEOM_SIZE, (geom_peg + 1, 3))[geom_peg]
    r, half, hole = size[0], size[1], plate.hole
    e1, e2, v, c, g = peg_end(data, geom_plate, geom_peg, half)
    end = End(c, e1, e2, v, r, math.sqrt(v[0] * v[0] + v[1] * v[1]))
    if plate.has_flats > 0.0:
        count = geom_plate + 1 + flats.FLATS
        xpos = native.array(data + native.DATA_GEOM_XPOS, (count, 3))[geom_plate:]
        xmat = native.array(data + native.DATA_GEOM_XMAT, (count, 3, 3))[geom_plate:]
        flats.aim(end, hole, xpos[0], xmat[0], xpos[1:], xmat[1:])
    lowest = c[2] - r * end.tilt
    if plate.mode == NONE or lowest > ABOVE:
        return
    away = math.sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2])
    meet = meeting(model, data, geom_plate, geom_peg, g, max(r, away + hole))
    if math.sqrt(c[0] * c[0] + c[1] * c[1]) > hole + r + NEAR and lowest > -NEAR:
        _collide_plane(meet, end)
    else:
        _collide_rim(meet, end)
    # The hole's edge can only be touched where it reaches above the end face and comes near the peg's side.
    along = -c[0] * v[0] - c[1] * v[1] - c[2] * v[2]
    beside = math.sqrt(max(away * away - along * along, 0.0))
    if along + hole * end.tilt > -1e-9 and beside <= hole + r + max(NEAR, FEATURE_BAND + meet.reach):
        _collide_edge(meet, end)


@njit(cache=True)
def _collide_plane(meet, end):  # type: ignore[no-untyped-def]
    """Add the rim against the plane where all of it is over solid plate."""
    for i in range(0, SCAN, SAMPLE_EVERY):
        if end.c[2] + end.r * (_COS[i] * end.e1[2] + _SIN[i] * end.e2[2]) <= SAMPLE_BAND + meet.reach:
            p, _ = _rim(end, _COS[i], _SIN[i])
            put(meet, p[2], p, UP, False, SAMPLE_BAND)
    if end.tilt > 1e-9:
        p = _lowest(end)
        put(meet, p[2], p, UP, False, FEATURE_BAND)


@njit(cache=True)
def _lowest(end):  # type: ignore[no-untyped-def]
    """Return the lowest point of a tilted rim, in closed form."""
    e1, e2 = end.e1, end.e2
    cosine = -e1[2] / math.sqrt(e1[2] * e1[2] + e2[2] * e2[2])
    sine = -e2[2] / math.sqrt(e1[2] * e1[2] + e2[2] * e2[2])
    p, _ = _rim(end, cosine, sine)
    return p


@njit(cache=True)
def _collide_rim(meet, end):  # type: ignore[no-untyped-def]
    """Add the peg's rim against plane, wall, edge and floor."""
    hole, depth = meet.hole, meet.depth
    Z, W = np.empty(SCAN), np.empty(SCAN)
    for i in range(SCAN):
        p, _ = _rim(end, _COS[i], _SIN[i])
        rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
        Z[i], W[i] = p[2], hole - rho
        if i % SAMPLE_EVERY == 0:
            if Z[i] >= W[i]:
                put(meet, Z[i], p, UP, False, SAMPLE_BAND)
            else:
                put(meet, W[i], p, _inward(p, rho), True, SAMPLE_BAND)
                put(meet, Z[i] + depth, p, UP, False, SAMPLE_BAND)
    if end.tilt > 1e-9:
        p = _lowest(end)
        rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
        if p[2] >= hole - rho:
            put(meet, p[2], p, UP, False, FEATURE_BAND)
        else:
            put(meet, p[2] + depth, p, UP, False, FEATURE_BAND)
    for i in range(SCAN):
        j = (i + 1) % SCAN
        h = (i - 1) % SCAN
        if W[i] <= W[h] and W[i] < W[j] and abs(W[i]) < NEAR:
            _rim_on_wall(meet, end, i * _ANGLE)
        if (Z[i] >= W[i]) != (Z[j] >= W[j]) and max(Z[i], W[i]) < NEAR + end.r * _ANGLE:
            _edge_on_edge(meet, end, (i * _ANGLE, (i + 1) * _ANGLE), (Z[i] - W[i], Z[j] - W[j]))


@njit(cache=True)
def _rim_on_wall(meet, end, angle):  # type: ignore[no-untyped-def]
    """Add the point of the rim near `angle` that is nearest the wall, unless the plane is nearer there: then it is no minimum."""
    hole, c = meet.hole, end.c
    # Newton on d(rho^2)/d(angle).
    for _ in range(4):
        p, dp = _rim(end, math.cos(angle), math.sin(angle))
        slope = p[0] * dp[0] + p[1] * dp[1]
        bend = dp[0] * dp[0] + dp[1] * dp[1] - p[0] * (p[0] - c[0]) - p[1] * (p[1] - c[1])
        if bend >= 0.0:
            break
        angle -= min(max(slope / bend, -_ANGLE), _ANGLE)
    p, _ = _rim(end, math.cos(angle), math.sin(angle))
    rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
    if hole - rho > p[2]:
        put(meet, hole - rho, p, _inward(p, rho), True, FEATURE_BAND)


@njit(cache=True)
def _edge_on_edge(meet, end, angles, values):  # type: ignore[no-untyped-def]
    """Add the point of the rim between two angles where plane and wall are equally far, by regula falsi (Illinois).

    Args:
        meet: Pair of plate and peg.
        end: End of the peg.
        angles: Angles of the rim on either side of the point, rad.
        values: Distance to the plane less distance to the wall at those angles, m; of unequal signs.
    """
    hole = meet.hole
    (lo, hi), (flo, fhi) = angles, values
    angle = lo
    for _ in range(8):
        angle = (lo * fhi - hi * flo) / (fhi - flo)
        p, dp = _rim(end, math.cos(angle), math.sin(angle))
        f = p[2] - hole + math.sqrt(p[0] * p[0] + p[1] * p[1])
        if f * fhi > 0.0:
            hi, fhi, flo = angle, f, 0.5 * flo
        else:
            lo, flo, fhi = angle, f, 0.5 * fhi
        if abs(f) < 1e-10:
            break
    p, dp = _rim(end, math.cos(angle), math.sin(angle))
    rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
    if rho <= 1e-9:
        return
    dz = dp[2]
    dw = -(p[0] * dp[0] + p[1] * dp[1]) / rho
    if dz * dw < 0.0:
        share = dw / (dw - dz)
        norm = math.sqrt(share * share + (1.0 - share) * (1.0 - share))
        wall = _inward(p, rho)
        n = ((1.0 - share) / norm * wall[0], (1.0 - share) / norm * wall[1], share / norm)
        put(meet, max(p[2], hole - rho) / norm, p, n, True, FEATURE_BAND)


@njit(cache=True)
def _collide_edge(meet, end):  # type: ignore[no-untyped-def]
    """Add the hole's edge against the peg's side."""
    hole = meet.hole
    clearance = np.empty(SCAN)
    for i in range(SCAN):
        clearance[i] = _clearance(end, hole * _COS[i], hole * _SIN[i])
    for i in range(SCAN):
        if i % SAMPLE_EVERY == 0:
            _put_edge(meet, end, _COS[i], _SIN[i], SAMPLE_BAND)
        before, after = clearance[(i - 1) % SCAN], clearance[(i + 1) % SCAN]
        if clearance[i] <= before and clearance[i] < after and abs(clearance[i]) < NEAR:
            angle = _nearest_the_axis(end, hole, i * _ANGLE)
            _put_edge(meet, end, math.cos(angle), math.sin(angle), FEATURE_BAND)


@njit(cache=True)
def _clearance(end, x, y):  # type: ignore[no-untyped-def]
    """Return the distance of a point of the surface from the peg's side, m, negative inside."""
    c, v = end.c, end.v
    q = (x - c[0], y - c[1], -c[2])
    along = q[0] * v[0] + q[1] * v[1] + q[2] * v[2]
    return math.sqrt(max(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] - along * along, 0.0)) - end.r


@njit(cache=True)
def _nearest_the_axis(end, hole, angle):  # type: ignore[no-untyped-def]
    """Return the point of the hole's edge that is nearest the peg's axis, searched from `angle`, rad."""
    c, v = end.c, end.v
    # Newton on the squared distance from the axis.
    for _ in range(4):
        cosine, sine = math.cos(angle), math.sin(angle)
        q = (hole * cosine - c[0], hole * sine - c[1], -c[2])
        dq = (-hole * sine, hole * cosine)
        along = q[0] * v[0] + q[1] * v[1] + q[2] * v[2]
        dalong = dq[0] * v[0] + dq[1] * v[1]
        slope = q[0] * dq[0] + q[1] * dq[1] - along * dalong
        bend = (
            dq[0] * dq[0]
            + dq[1] * dq[1]
            - q[0] * hole * cosine
            - q[1] * hole * sine
            - dalong * dalong
            + along * hole * (cosine * v[0] + sine * v[1])
        )
        if bend <= 0.0:
            break
        angle -= min(max(slope / bend, -_ANGLE), _ANGLE)
    return angle


@njit(cache=True)
def _put_edge(meet, end, cosine, sine, band):  # type: ignore[no-untyped-def]
    """Add the peg's side against one point of the hole's edge: distance from the axis less the radius, above the end face."""
    hole, c, v, r = meet.hole, end.c, end.v, end.r
    p = (hole * cosine, hole * sine, 0.0)
    q = (p[0] - c[0], p[1] - c[1], -c[2])
    along = q[0] * v[0] + q[1] * v[1] + q[2] * v[2]
    if along <= 0.0:
        return
    n = (along * v[0] - q[0], along * v[1] - q[1], along * v[2] - q[2])
    distance = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    if distance < 1e-9 or distance - r < -along:
        return
    n = (n[0] / distance, n[1] / distance, n[2] / distance)
    put(meet, distance - r, p, n, True, band)


@cfunc(types.int32(types.intp, types.intp, types.intp, types.int32, types.int32, types.float64), cache=True)
def _hook(model, data, buffer, geom_plate, geom_peg, margin):  # type: ignore[no-untyped-def]
    collide(model, data, geom_plate, geom_peg)
    return 0


def install() -> None:
    """Put the exact contacts into this process's collision table; harmless when repeated."""
    native.collide_by(PLATE_TYPE, PEG_TYPE, _hook.address)
