"""Exact depth of a tilted peg in its hole, computed from sections, independent of any simulation."""

import math
from collections.abc import Callable
from functools import cache
from itertools import pairwise

import numpy as np

from drivers.part.contract import Part
from drivers.quantities import Vector

DEEPEST = 0.03
"""Upper end of the search for the depth, m."""


def exact_depth(peg: Part, hole: Part, axes: Vector) -> float:
    """Return the exact depth of the lowest point of a peg with these axes, shape (3, 3), in a hole along x and y, m."""
    if peg.face.flat_width > 0.0:
        return polygonal_depth(peg, hole, axes)
    return round_depth(peg, hole, math.atan2(math.hypot(axes[0, 2], axes[1, 2]), axes[2, 2]))


def deepest(fits: Callable[[float], bool]) -> float:
    """Return the largest depth that fits, m, by bisection to a nanometre."""
    low, high = 0.0, DEEPEST
    for _ in range(25):
        depth = (low + high) / 2.0
        low, high = (depth, high) if fits(depth) else (low, depth)
    return low


@cache
def round_depth(peg: Part, hole: Part, tilt: float, points: int = 2001) -> float:
    """Return the exact depth of the lowest point of a round peg in a round hole, m, with or without chamfers.

    The test follows lines on the peg's surface, from the rim of its end over its chamfer and up its side. The hole's
    radius is piecewise linear in the height, with breaks at the surface and at the lower end of the chamfer. The distance
    from an axis is convex along a straight line. A line of the surface therefore fits if four kinds of points fit: its
    ends, its bend, and its points at the heights of the breaks.

    Args:
        peg: Cross-section of the peg.
        hole: Cross-section of the hole.
        tilt: Angle between the axes, rad, > 0.
        points: Number of lines on half the symmetric peg.
    """
    angle = np.linspace(0.0, math.pi, points)
    tilted = np.array([[math.cos(tilt), 0.0, math.sin(tilt)], [0.0, 1.0, 0.0], [-math.sin(tilt), 0.0, math.cos(tilt)]])
    ways = ((peg.reach - peg.chamfer, 0.0), (peg.reach, peg.chamfer), (peg.reach, peg.chamfer + 10.0 * DEEPEST))
    knots = np.array(
        [
            tilted @ np.array([radius * np.cos(angle), radius * np.sin(angle), np.full(points, height)])
            for radius, height in ways
        ]
    )
    lowest = float(knots[:, 2].min())

    def fits(depth: float) -> bool:
        lift = np.array([[0.0], [0.0], [-lowest - depth]])
        told = list(knots + lift)
        told += [_at(a, b, level) for a, b in pairwise(told) for level in (0.0, -hole.chamfer)]
        x, y, z = np.concatenate(told, axis=1)
        room = hole.reach + np.maximum(hole.chamfer + z, 0.0)
        x, y, room = (each[z <= 1e-12] for each in (x, y, room))
        low, high = -2.0 * hole.reach, 2.0 * hole.reach
        for _ in range(40):
            third = (high - low) / 3.0
            ahead, behind = (float(np.max(np.hypot(x - at, y) - room)) for at in (low + third, high - third))
            low, high = (low, high - third) if ahead < behind else (low + third, high)
        return bool(np.max(np.hypot(x - low, y) - room) <= 0.0)

    return deepest(fits)


def _at(start: Vector, end: Vector, level: float) -> Vector:
    """Return the points of lines, from `start` to `end`, each of shape (3, n), m, at the height `level`, m.

    If a line does not reach the height, the result is its start.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (level - start[2]) / (end[2] - start[2])
    share = np.where((share >= 0.0) & (share <= 1.0), share, 0.0)
    return start + share * (end - start)


def polygonal_depth(peg: Part, hole: Part, axes: Vector) -> float:
    """Return the exact depth of the lowest corner by the full section test, m, in a rectangular hole along x and y.

    The projection of the part of the peg below the surface must fit between the walls. The projection is the convex hull
    of the corners below the surface and of the intersections of the peg's edges with the surface.

    Args:
        peg: Cross-section of the peg, a polygon.
        hole: Cross-section of the hole.
        axes: Axes of the peg, z from its end upward, shape (3, 3).
    """
    corners = peg.outline() @ axes[:, :2].T
    ends = np.concatenate([np.roll(corners, -1, axis=0), corners + 2.0 * DEEPEST / axes[2, 2] * axes[:, 2]])
    starts = np.concatenate([corners, corners])
    sides = 2.0 * np.array(hole.half)

    def fits(depth: float) -> bool:
        surface = corners[:, 2].min() + depth
        crosses = (starts[:, 2] - surface) * (ends[:, 2] - surface) < 0.0
        a, b = starts[crosses], ends[crosses]
        cut = a + (b - a) * ((surface - a[:, 2]) / (b[:, 2] - a[:, 2]))[:, None]
        below = np.concatenate([corners[corners[:, 2] <= surface], cut])[:, :2]
        return bool((np.ptp(below, axis=0) <= sides).all())

    return deepest(fits)
