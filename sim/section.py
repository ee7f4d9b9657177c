"""How deep a tilted peg can go into a round hole: the exact test by sections, independent of any simulation."""

import math
from functools import cache

import numpy as np

DEEPEST = 0.03
"""Where the search for the depth ends, m."""


@cache
def section_depth(diameter: float, hole: float, tilt: float, points: int = 40001) -> float:
    """Return the exact depth of the lowest point by the full section test, m.

    The part of the peg below the surface, projected on the surface, must fit inside the hole's disc. Its outline
    is made of the rim below the surface and of where the peg's side leaves the surface.

    Args:
        diameter: Of the peg, m.
        hole: Diameter of the hole, m.
        tilt: Between the axes, rad, > 0.
        points: Of the rim.
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
