"""How deep a tilted peg can go into a hole, by polygon clipping: an oracle that shares nothing with the contact code."""

import numpy as np
from shapely import MultiPoint, Polygon
from shapely.affinity import rotate, translate

from drivers.part.contract import Part

LENGTH = 0.2
"""Of the peg, m: longer than any depth that is asked about."""
DEEPEST = 0.03


def deepest(peg: Part, hole: Part, axes: np.ndarray, yaw: float = 0.0) -> float:
    """Return the greatest depth of the peg's lowest point at which it fits into the hole's mouth wherever it stands, m.

    What of the peg lies below the surface, projected on the surface, must fit inside the hole. Both are convex, so it fits
    where one displacement keeps each of its corners inside: where the hole, moved against every corner, has a point in common.

    Args:
        peg: Cross-section of the peg.
        hole: Cross-section of the hole.
        axes: Of the peg, z from its end upward, shape (3, 3).
        yaw: By which the hole is turned about the surface's normal, rad.
    """
    end = peg.outline() @ axes[:, :2].T
    mouth = rotate(Polygon(hole.outline()), yaw, origin=(0.0, 0.0), use_radians=True)

    def fits(depth: float) -> bool:
        below = below_surface(end, axes[:, 2], float(end[:, 2].min()) + depth)
        corners = np.array(MultiPoint(below).convex_hull.exterior.coords)[:-1]
        free = mouth
        for x, y in corners:
            free = free.intersection(translate(mouth, -x, -y))
        return not free.is_empty

    low, high = 0.0, DEEPEST
    for _ in range(40):
        depth = (low + high) / 2.0
        low, high = (depth, high) if fits(depth) else (low, depth)
    return low


def penetration(peg: Part, hole: Part, axes: np.ndarray, place: np.ndarray) -> float:
    """Return how deep a peg is in the solid round the hole's mouth, m: the least way straight up or square to the walls, to 0.2 um.

    Args:
        peg: Cross-section of the peg.
        hole: Cross-section of a rectangular hole.
        axes: Of the peg, z from its end upward, shape (3, 3).
        place: Middle of the peg's end, shape (3,), m, from the hole's mouth.
    """
    end, half = peg.outline() @ axes[:, :2].T + place, hole.outline().max(axis=0)

    def beyond(depth: float) -> float:
        below = below_surface(end, axes[:, 2], -depth)
        return float((np.abs(below) - half).max()) if len(below) else -1.0

    low, high = 0.0, 1e-3
    for _ in range(13):
        depth = (low + high) / 2.0
        low, high = (depth, high) if beyond(depth) > depth else (low, depth)
    return low


def below_surface(end: np.ndarray, axis: np.ndarray, surface: float) -> np.ndarray:
    """Return corners of the prism below a height and where its edges pass through it, projected, shape (n, 2)."""
    starts = np.concatenate([end, end])
    ends = np.concatenate([np.roll(end, -1, axis=0), end + LENGTH * axis])
    crosses = (starts[:, 2] - surface) * (ends[:, 2] - surface) < 0.0
    a, b = starts[crosses], ends[crosses]
    cut = a + (b - a) * ((surface - a[:, 2]) / (b[:, 2] - a[:, 2]))[:, None]
    points: np.ndarray = np.concatenate([end[end[:, 2] <= surface], cut])[:, :2]
    return points
