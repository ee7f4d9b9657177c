"""How deep a leaning peg goes into its hole, and how far a peg in its hole can lean; pure."""

import math

LEAST = 1e-5
"""Lean below which a peg counts as upright, rad."""
STEEPEST = math.radians(8.0)
"""Largest lean between the walls that is looked at, rad: beyond it a peg leans over the rim."""


def allowed_depth(phi: float, peg: float, hole: float) -> float:
    """Return the largest depth of the lowest point of a peg that is tilted by `phi` > 0, rad, in a hole; diameters and
    depth in m.

    In the plane of the tilt, which is exact to 1 um below 8 degrees: the side of the peg lies in the hole by s, where
    s sin(phi) + peg cos(phi) = hole. Chamfers are left out; a chamfered peg or hole allows more.
    """
    return (hole - peg * math.cos(phi)) / math.tan(phi)


def allowed_tilt(depth: float, peg: float, hole: float) -> float:
    """Return the largest lean of a round peg that is `depth` m deep in a round hole, rad, by bisection of `allowed_depth`; diameters in m.

    Beyond `STEEPEST` that formula does not hold; it is what a peg gets that is less deep. Chamfers are left out as well, and
    allow a larger lean.
    """
    low, high = LEAST, STEEPEST
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (middle, high) if allowed_depth(middle, peg, hole) > depth else (low, middle)
    return low
