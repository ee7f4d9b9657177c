"""Decoys: places on the plate that the search mistook for the hole and passes over from then on; pure."""

import math
from typing import NamedTuple

from drivers.parts import Hole
from skills.search.tour import Point
from skills.seating.decision import CLOSED_TOLERANCE

SHALLOW = 0.5
"""Share of the hole's depth below which a peg that goes no deeper stands in a decoy, fraction."""
BLIND = 0.75
"""Radius of a decoy with a bottom, in which the peg is not put down, share of the hole's width."""
THROUGH = 1.5
"""Radius of a decoy without a bottom, share of the hole's width; the peg may have stood anywhere in it."""


class Decoy(NamedTuple):
    """A place where the peg is not put down."""

    place: Point
    """Its middle, m, base frame."""
    radius: float
    """Its radius, m."""


def decoy_at(edge: Point, place: Point, depth: float, hole: Hole) -> Decoy | None:
    """Return the decoy if the peg was given up far above the bottom of the hole, or below it; otherwise None.

    A decoy holds the peg, which therefore fell in within the decoy's radius from where it was given up.

    Args:
        edge: Lowest point of the peg when it fell in, shape (2,), m, base frame.
        place: End point of the peg when it was given up, shape (2,), m, base frame.
        depth: Its depth below the surface, m.
        hole: The hole as the job states it.
    """
    if SHALLOW * hole.depth <= depth <= hole.depth + CLOSED_TOLERANCE:
        return None
    radius = hole.part.inscribed * (BLIND if depth < SHALLOW * hole.depth else THROUGH)
    return Decoy(place, radius) if math.dist(edge, place) <= radius else None
