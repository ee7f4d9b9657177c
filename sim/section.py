"""The exact depth of a tilted peg in its hole, by sections and independent of any simulation."""

import math
from functools import cache

import numpy as np

from drivers.part.contract import Part
from drivers.quantities import Vector

DEEPEST = 0.03
"""Depth at which the search for the depth ends, m."""


@cache
def section_depth(diameter: float, hole: float, tilt: float, points: int = 40001) -> float:
    """Return the exact depth of the lowest point by the full section test, m.

    The part of the peg below the surface, projected on the surface, must fit inside the hole's disc. Its outline
    is made of the rim below the surface and of where the peg's side leaves the surface.

    Args:
        diameter: Diameter of the peg, m.
        hole: Diameter of the hole, m.
        tilt: Angle between the axes, rad, > 0.
        points: Number of points on the rim.
    """
    r = diameter / 2
    angle = np.linspace(0.0, 2.0 * math.pi, points)
    x, y = r * np.cos(angle) * math.cos(tilt), r * np.sin(angle)

    def fits(depth: float) -> bool:
        z = r * math.sin(tilt) - depth - r * np.cos(angle) * math.sin(tilt)
        below = z <= 0.0
        px = np.concatenate([x[below], x[below] - z[below] * math.tan(tilt)])
        py = np.concatenate([y[below], y[below]])
        low, high = -hole, hole
        for _ in range(60):
            third = (high - low) / 3.0
            if np.max((px - low - third) ** 2 + py**2) < np.max((px - high + third) ** 2 + py**2):
                high -= third
            else:
                low += third
        return bool(np.max((px - low) ** 2 + py**2) <= (hole / 2) ** 2)

    low, high = 0.0, DEEPEST
    for _ in range(40):
        depth = (low + high) / 2.0
        low, high = (depth, high) if fits(depth) else (low, depth)
    return low


def polygonal_depth(peg: Part, hole: Part, axes: Vector) -> float:
    """Return the exact depth of the lowest corner by the full section test, m, in a rectangular hole along x and y.

    The part of the peg below the surface, projected on the surface, must fit between the walls: the section is the
    convex hull of the corners below and of where edges of the peg pass through the surface.

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

    low, high = 0.0, DEEPEST
    for _ in range(40):
        depth = (low + high) / 2.0
        low, high = (depth, high) if fits(depth) else (low, depth)
    return low
