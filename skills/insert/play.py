"""Depth of a tilted peg at two-point contact, and the largest tilt of a peg at a given depth; pure."""

import math

LEAST = 1e-5
"""Tilt below which a peg counts as upright, rad. Source: chosen, not measured."""
STEEPEST = math.radians(8.0)
"""Largest tilt between the walls, rad; at larger tilts the peg leans over the rim. Source: chosen, not measured."""


def allowed_depth(phi: float, peg: float, hole: float) -> float:
    """Return the largest depth, m, of the lowest point of a peg tilted by `phi` > 0, rad, in a hole; diameters in m.

    The side of the peg is in the hole over the length s, with s sin(phi) + peg cos(phi) = hole in the plane of the tilt.
    This is exact to 1 um below 8 degrees. Chamfers are neglected; with a chamfer the peg can go deeper.
    """
    # Depth s cos(phi) = (hole - peg cos(phi)) / tan(phi)
    return (hole - peg * math.cos(phi)) / math.tan(phi)


def allowed_tilt(depth: float, peg: float, hole: float) -> float:
    """Return the largest tilt, rad, of a round peg at `depth`, m, in a round hole, by bisection of `allowed_depth`; diameters in m.

    The formula does not hold above `STEEPEST`, so `STEEPEST` is returned for smaller depths. Chamfers are neglected; with
    a chamfer the tilt can be larger.
    """
    low, high = LEAST, STEEPEST
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (middle, high) if allowed_depth(middle, peg, hole) > depth else (low, middle)
    return low
