"""Decoys: places on the plate that the search mistook for the hole and skips afterwards; pure."""

import math
from typing import NamedTuple

from drivers.parts import Hole
from skills.search.tour import Point
from skills.seating.decision import CLOSED_TOLERANCE

SHALLOW = 0.5
"""Share of the hole's depth, fraction; if a peg does not reach this depth, it is in a decoy."""
BLIND = 0.75
"""Radius of a decoy with a bottom, share of the hole's width; the search does not put the peg down within it."""
THROUGH = 1.5
"""Radius of a decoy without a bottom, share of the hole's width; the peg may have been anywhere in it."""


class Decoy(NamedTuple):
    """A place at which the search does not put the peg down."""

    place: Point
    """Middle of the decoy, shape (2,), m, base frame."""
    radius: float
    """Radius of the decoy, m."""


def decoy_at(edge: Point, place: Point, depth: float, hole: Hole) -> Decoy | None:
    """Return the decoy if the attempt ended with the peg far above the bottom of the hole, or below it; otherwise None.

    A decoy holds the peg. If the peg fell in further away than the decoy's radius, the result is therefore None.

    Args:
        edge: Lowest point of the peg when it fell in, shape (2,), m, base frame.
        place: End point of the peg at the end of the attempt, shape (2,), m, base frame.
        depth: Depth of the end point below the surface, m.
        hole: The hole stated in the job.
    """
    if SHALLOW * hole.depth <= depth <= hole.depth + CLOSED_TOLERANCE:
        return None
    radius = hole.part.inscribed * (BLIND if depth < SHALLOW * hole.depth else THROUGH)
    return Decoy(place, radius) if math.dist(edge, place) <= radius else None
