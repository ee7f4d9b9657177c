"""Contacts of a round peg's rims with a plate: its surface, the wall of its bore, its chamfer, its edges and its floor.

Every point of a rim must stay out of the solid {z < 0, rho > R, rho > R + c + z}. Its clearance is g = max(z, R - rho,
(R + c - rho + z) / sqrt 2), from the distances to plane, wall and cone; without a chamfer, c = 0, there is no cone. The
local minima of g over the rim are rim on plane (g = z), rim on wall (g = R - rho) and rim on cone. If two terms are
equal, the minimum is edge on edge. Its normal is the convex combination of the two normals that is perpendicular to the
rim: the cross product of the two edges' tangents.
"""

import math
from typing import NamedTuple

import numpy as np

from drivers.compiled import njit
from sim.contact.table import FEATURE_BAND, NEAR, PENETRATION, SAMPLE_BAND, SURFACE, put

SCAN = 48
"""Number of points of a peg's rim, and of a hole's edge, in the scan for minima."""
SAMPLE_EVERY = 3
"""Interval of the scanned points that are also contacts on nearly conformal surfaces."""
UP = (0.0, 0.0, 1.0)
SLANT = math.sqrt(0.5)
"""Sine and cosine of a chamfer's angle."""
PLANE, CONE, WALL = (0.0, 1.0), (SLANT, SLANT), (1.0, 0.0)
"""Normals of the faces of a plate, components into the hole and upward."""

ANGLE = 2.0 * math.pi / SCAN
COS = np.cos(ANGLE * np.arange(SCAN))
SIN = np.sin(ANGLE * np.arange(SCAN))


class End(NamedTuple):
    """A rim of a round peg in the plate's frame: that of its end face, or the upper rim of its chamfer."""

    c: tuple[float, float, float]
    """Centre of the rim, m."""
    e1: tuple[float, float, float]
    """First axis in the plane of the rim."""
    e2: tuple[float, float, float]
    """Second axis in the plane of the rim."""
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


@njit(cache=True, inline="always")
def _mouth(meet):  # type: ignore[no-untyped-def]
    """Return the radius of the hole's chamfer at the surface, m; minus infinity without a chamfer."""
    return meet.hole + meet.chamfer if meet.chamfer > 0.0 else -math.inf


@njit(cache=True, inline="always")
def _cone(mouth, height, rho):  # type: ignore[no-untyped-def]
    """Return the distance of a point from the hole's chamfer, m."""
    return SLANT * (mouth - rho + height)


@njit(cache=True)
def _put_cone(meet, distance, p, rho, band):  # type: ignore[no-untyped-def]
    """Add a point of the rim against the hole's chamfer."""
    wall = _inward(p, rho)
    put(meet, distance, p, (SLANT * wall[0], SLANT * wall[1], SLANT), PENETRATION, band)


@njit(cache=True, inline="always")
def collide_plane(meet, end):  # type: ignore[no-untyped-def]
    """Add the rim against the plane if the whole rim is over solid plate."""
    for i in range(0, SCAN, SAMPLE_EVERY):
        if end.c[2] + end.r * (COS[i] * end.e1[2] + SIN[i] * end.e2[2]) <= SAMPLE_BAND + meet.reach:
            p, _ = _rim(end, COS[i], SIN[i])
            put(meet, p[2], p, UP, SURFACE, SAMPLE_BAND)
    if end.tilt > 1e-9:
        p = _lowest(end)
        put(meet, p[2], p, UP, SURFACE, FEATURE_BAND)


@njit(cache=True)
def _lowest(end):  # type: ignore[no-untyped-def]
    """Return the lowest point of a tilted rim, in closed form."""
    e1, e2 = end.e1, end.e2
    cosine = -e1[2] / math.sqrt(e1[2] * e1[2] + e2[2] * e2[2])
    sine = -e2[2] / math.sqrt(e1[2] * e1[2] + e2[2] * e2[2])
    p, _ = _rim(end, cosine, sine)
    return p


@njit(cache=True, inline="always")
def collide_rim(meet, end):  # type: ignore[no-untyped-def]
    """Add the peg's rim against plane, wall, chamfer, edges and floor."""
    hole, mouth = meet.hole, _mouth(meet)
    Z, W = np.empty(SCAN), np.empty(SCAN)
    for i in range(SCAN):
        p, _ = _rim(end, COS[i], SIN[i])
        rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
        Z[i], W[i] = p[2], hole - rho
        if i % SAMPLE_EVERY == 0:
            cone = _cone(mouth, Z[i], rho)
            if Z[i] >= max(W[i], cone):
                put(meet, Z[i], p, UP, SURFACE, SAMPLE_BAND)
            else:
                if cone > W[i]:
                    _put_cone(meet, cone, p, rho, SAMPLE_BAND)
                else:
                    put(meet, W[i], p, _inward(p, rho), PENETRATION, SAMPLE_BAND)
                put(meet, Z[i] + meet.depth, p, UP, SURFACE, SAMPLE_BAND)
    if end.tilt > 1e-9:
        p = _lowest(end)
        rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
        is_outside = p[2] >= max(hole - rho, _cone(mouth, p[2], rho))
        put(meet, p[2] if is_outside else p[2] + meet.depth, p, UP, SURFACE, FEATURE_BAND)
    near = NEAR + end.r * ANGLE
    for i in range(SCAN):
        j = (i + 1) % SCAN
        h = (i - 1) % SCAN
        if W[i] <= W[h] and W[i] < W[j] and abs(W[i]) < NEAR:
            _rim_on_wall(meet, end, i * ANGLE)
        if _is_crossed((Z[i], Z[j]), (W[i], W[j]), near):
            _edge_on_edge(meet, end, i, (PLANE, WALL, CONE), (Z[i] - W[i], Z[j] - W[j]))
    if meet.chamfer > 0.0:
        _collide_cone(meet, end, Z, W)


@njit(cache=True, inline="always")
def _collide_cone(meet, end, Z, W):  # type: ignore[no-untyped-def]
    """Add the peg's rim against the hole's chamfer and both its edges, given the rim's distances to plane and wall, m."""
    near = NEAR + end.r * ANGLE
    S = SLANT * (meet.chamfer + W + Z)
    for i in range(SCAN):
        j = (i + 1) % SCAN
        h = (i - 1) % SCAN
        if S[i] <= S[h] and S[i] < S[j] and abs(S[i]) < NEAR:
            _rim_on_cone(meet, end, i * ANGLE)
        if _is_crossed((Z[i], Z[j]), (S[i], S[j]), near):
            _edge_on_edge(meet, end, i, (PLANE, CONE, WALL), (Z[i] - S[i], Z[j] - S[j]))
        if _is_crossed((S[i], S[j]), (W[i], W[j]), near):
            _edge_on_edge(meet, end, i, (CONE, WALL, PLANE), (S[i] - W[i], S[j] - W[j]))


@njit(cache=True, inline="always")
def _rim_on_wall(meet, end, angle):  # type: ignore[no-untyped-def]
    """Add the point of the rim near `angle` that is nearest to the wall.

    If another face is nearer there, the point is no minimum and is omitted.
    """
    hole, c = meet.hole, end.c
    # Newton's method on d(rho²)/d(angle).
    for _ in range(4):
        p, dp = _rim(end, math.cos(angle), math.sin(angle))
        slope = p[0] * dp[0] + p[1] * dp[1]
        bend = dp[0] * dp[0] + dp[1] * dp[1] - p[0] * (p[0] - c[0]) - p[1] * (p[1] - c[1])
        if bend >= 0.0:
            break
        angle -= min(max(slope / bend, -ANGLE), ANGLE)
    p, _ = _rim(end, math.cos(angle), math.sin(angle))
    rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
    if hole - rho > max(p[2], _cone(_mouth(meet), p[2], rho)):
        put(meet, hole - rho, p, _inward(p, rho), PENETRATION, FEATURE_BAND)


@njit(cache=True, inline="always")
def _rim_on_cone(meet, end, angle):  # type: ignore[no-untyped-def]
    """Add the point of the rim near `angle` that is nearest to the chamfer, unless another face is nearer there."""
    c = end.c
    # Newton's method on d(z - rho)/d(angle).
    for _ in range(4):
        p, dp = _rim(end, math.cos(angle), math.sin(angle))
        rho = max(math.sqrt(p[0] * p[0] + p[1] * p[1]), 1e-9)
        drho = (p[0] * dp[0] + p[1] * dp[1]) / rho
        outward = dp[0] * dp[0] + dp[1] * dp[1] - p[0] * (p[0] - c[0]) - p[1] * (p[1] - c[1])
        bend = c[2] - p[2] - (outward - drho * drho) / rho
        if bend <= 0.0:
            break
        angle -= min(max((dp[2] - drho) / bend, -ANGLE), ANGLE)
    p, _ = _rim(end, math.cos(angle), math.sin(angle))
    rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
    distance = _cone(_mouth(meet), p[2], rho)
    if distance > max(p[2], meet.hole - rho):
        _put_cone(meet, distance, p, rho, FEATURE_BAND)


@njit(cache=True, inline="always")
def _is_crossed(first, second, near):  # type: ignore[no-untyped-def]
    """Return True if the nearer of two faces changes between a scanned point and the next one, and both are near there.

    Args:
        first: Distances to the first face at both points, m.
        second: Distances to the second face at both points, m.
        near: Distance up to which they are near, m.
    """
    return (first[0] >= second[0]) != (first[1] >= second[1]) and max(first[0], second[0]) < near


@njit(cache=True, inline="always")
def _distance(meet, face, p, rho):  # type: ignore[no-untyped-def]
    """Return the distance of a point from a face of the plate, m."""
    return face[0] * (_radius(meet, face) - rho) + face[1] * p[2]


@njit(cache=True, inline="always")
def _radius(meet, face):  # type: ignore[no-untyped-def]
    """Return the radius at which a face meets the surface, m."""
    return meet.hole + meet.chamfer if face[0] * face[1] > 0.0 else meet.hole


@njit(cache=True)
def _edge_on_edge(meet, end, i, faces, values):  # type: ignore[no-untyped-def]
    """Add the point of the rim after a scanned one at equal distance from two faces, by regula falsi (Illinois).

    Args:
        meet: Pair of plate and peg.
        end: Rim of the peg.
        i: Number of the scanned point.
        faces: The two faces, and the third one, which must not be nearer.
        values: Distance to the first face minus distance to the second at that point and the next one, m; of opposite
            signs.
    """
    one, two, other = faces
    radius = two[0] * _radius(meet, two) - one[0] * _radius(meet, one)
    lo, hi, (flo, fhi) = i * ANGLE, (i + 1) * ANGLE, values
    angle = lo
    for _ in range(8):
        angle = (lo * fhi - hi * flo) / (fhi - flo)
        p, dp = _rim(end, math.cos(angle), math.sin(angle))
        rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
        f = (one[1] - two[1]) * p[2] - radius + (two[0] - one[0]) * rho
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
    gap = max(_distance(meet, one, p, rho), _distance(meet, two, p, rho))
    if meet.chamfer > 0.0 and _distance(meet, other, p, rho) > gap:
        return
    inward = -(p[0] * dp[0] + p[1] * dp[1]) / rho
    slope = one[0] * inward + one[1] * dp[2]
    slope_two = two[0] * inward + two[1] * dp[2]
    if slope * slope_two < 0.0:
        share = slope_two / (slope_two - slope)
        across, upward = share * one[0] + (1.0 - share) * two[0], share * one[1] + (1.0 - share) * two[1]
        norm = math.sqrt(upward * upward + across * across)
        wall = _inward(p, rho)
        put(
            meet,
            gap / norm,
            p,
            (across / norm * wall[0], across / norm * wall[1], upward / norm),
            PENETRATION,
            FEATURE_BAND,
        )
