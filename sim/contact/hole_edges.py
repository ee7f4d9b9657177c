"""Contacts of a round hole's edges with a round peg's side and the chamfer of its end.

Every point of an edge must stay out of the peg {d < r, d < r + s, s > -cp}: s is the point's height above the upper rim
of the peg's chamfer along the peg's axis, d its distance from that axis, r the peg's radius, and cp the height of the
chamfer. Without a chamfer, cp = 0: the rim is that of the end, and there is no cone.
"""

import math

import numpy as np

from drivers.compiled import njit
from sim.contact.peg_rims import ANGLE, COS, SAMPLE_EVERY, SCAN, SIN, SLANT
from sim.contact.table import FEATURE_BAND, NEAR, PENETRATION, SAMPLE_BAND, put


@njit(cache=True)
def collide_edge(meet, end, chamfer, radius, height):  # type: ignore[no-untyped-def]
    """Add an edge of the hole against the peg's side and chamfer, at points above the end face and near the peg.

    Args:
        meet: Pair of plate and peg.
        end: Upper rim of the peg's chamfer, or its only rim.
        chamfer: Width and height of the peg's chamfer, m.
        radius: Radius of the edge, m.
        height: Height of the edge above the plate's surface, m.
    """
    q, along = _from_rim(end, (0.0, 0.0, height))
    away = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
    beside = math.sqrt(max(away * away - along * along, 0.0))
    if along + radius * end.tilt <= -chamfer - 1e-9 or beside > radius + end.r + max(NEAR, FEATURE_BAND + meet.reach):
        return
    clearance = np.empty((2, SCAN))
    side, cone = clearance[0], clearance[1]
    for i in range(SCAN):
        side[i], cone[i] = _clearance(end, (radius * COS[i], radius * SIN[i], height))
    for i in range(SCAN):
        if i % SAMPLE_EVERY == 0:
            _put_edge(meet, end, chamfer, (radius * COS[i], radius * SIN[i], height), SAMPLE_BAND)
        before, after = (i - 1) % SCAN, (i + 1) % SCAN
        if side[i] <= side[before] and side[i] < side[after] and abs(side[i]) < NEAR:
            angle = _nearest_the_axis(end, radius, height, i * ANGLE)
            p = (radius * math.cos(angle), radius * math.sin(angle), height)
            if chamfer <= 0.0 or not _is_on_cone(end, p):
                _put_edge(meet, end, chamfer, p, FEATURE_BAND)
        if chamfer > 0.0 and cone[i] <= cone[before] and cone[i] < cone[after] and abs(cone[i]) < NEAR:
            angle = _nearest_the_cone(end, radius, height, i * ANGLE)
            p = (radius * math.cos(angle), radius * math.sin(angle), height)
            if _is_on_cone(end, p):
                _put_edge(meet, end, chamfer, p, FEATURE_BAND)


@njit(cache=True)
def _from_rim(end, p):  # type: ignore[no-untyped-def]
    """Return the vector from the centre of the peg's rim to a point, and its component along the peg's axis, m."""
    c, v = end.c, end.v
    q = (p[0] - c[0], p[1] - c[1], p[2] - c[2])
    return q, q[0] * v[0] + q[1] * v[1] + q[2] * v[2]


@njit(cache=True)
def _clearance(end, p):  # type: ignore[no-untyped-def]
    """Return the distances of a point from the peg's side and from the cone of its chamfer, m; negative inside."""
    q, along = _from_rim(end, p)
    side = math.sqrt(max(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] - along * along, 0.0)) - end.r
    # Side: d - r. Cone: (d - r - s) / sqrt 2.
    return side, SLANT * (side - along)


@njit(cache=True, inline="always")
def _is_on_cone(end, p):  # type: ignore[no-untyped-def]
    """Return True if a point would touch the cone of the peg's chamfer rather than its side."""
    side, cone = _clearance(end, p)
    return cone > side


@njit(cache=True, inline="always")
def _nearest_the_axis(end, radius, height, angle):  # type: ignore[no-untyped-def]
    """Return the point of the hole's edge nearest to the peg's axis, searched from `angle`, rad."""
    v = end.v
    # Newton's method on half the squared distance from the axis, F = d²/2: a <- a - F'/F''.
    for _ in range(4):
        cosine, sine = math.cos(angle), math.sin(angle)
        q, along = _from_rim(end, (radius * cosine, radius * sine, height))
        dq = (-radius * sine, radius * cosine)
        dalong = dq[0] * v[0] + dq[1] * v[1]
        slope = q[0] * dq[0] + q[1] * dq[1] - along * dalong
        bend = (
            dq[0] * dq[0]
            + dq[1] * dq[1]
            - q[0] * radius * cosine
            - q[1] * radius * sine
            - dalong * dalong
            + along * radius * (cosine * v[0] + sine * v[1])
        )
        if bend <= 0.0:
            break
        angle -= min(max(slope / bend, -ANGLE), ANGLE)
    return angle


@njit(cache=True, inline="always")
def _nearest_the_cone(end, radius, height, angle):  # type: ignore[no-untyped-def]
    """Return the point of the hole's edge nearest to the cone of the peg's chamfer, searched from `angle`, rad."""
    v = end.v
    # Newton's method on the distance from the axis minus the height above the rim.
    for _ in range(4):
        cosine, sine = math.cos(angle), math.sin(angle)
        q, along = _from_rim(end, (radius * cosine, radius * sine, height))
        dq = (-radius * sine, radius * cosine)
        dalong, bow = dq[0] * v[0] + dq[1] * v[1], -radius * (cosine * v[0] + sine * v[1])
        distance = math.sqrt(max(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] - along * along, 1e-18))
        outward = (q[0] * dq[0] + q[1] * dq[1] - along * dalong) / distance
        square = radius * radius - q[0] * radius * cosine - q[1] * radius * sine - dalong * dalong - along * bow
        bend = square / distance - outward * outward / distance - bow
        if bend <= 0.0:
            break
        angle -= min(max((outward - dalong) / bend, -ANGLE), ANGLE)
    return angle


@njit(cache=True)
def _put_edge(meet, end, chamfer, p, band):  # type: ignore[no-untyped-def]
    """Add one point of a hole's edge against the peg's side or the cone of its chamfer, above the end face."""
    v, r = end.v, end.r
    q, along = _from_rim(end, p)
    above = along + chamfer
    if above <= 0.0:
        return
    n = (along * v[0] - q[0], along * v[1] - q[1], along * v[2] - q[2])
    distance = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    if distance < 1e-9:
        return
    gap = distance - r
    n = (n[0] / distance, n[1] / distance, n[2] / distance)
    if chamfer > 0.0 and SLANT * (gap - along) > gap:
        gap = SLANT * (gap - along)
        n = (SLANT * (n[0] + v[0]), SLANT * (n[1] + v[1]), SLANT * (n[2] + v[2]))
    if gap >= -above:
        put(meet, gap, p, n, PENETRATION, band)
