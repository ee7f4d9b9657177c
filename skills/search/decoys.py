"""Decoys: places on the plate that the search mistook for the hole and passes over from then on; pure."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from drivers.parts import Hole
from drivers.quantities import Vector
from skills.search.tour import Path, Point
from skills.seating.decision import CLOSED_TOLERANCE

SHALLOW = 0.5
"""Share of the hole's depth below which a peg that goes no deeper stands in a decoy, fraction."""
BLIND = 0.75
"""Radius of a decoy with a bottom, in which the peg is not put down, share of the hole's width."""
THROUGH = 1.5
"""Radius of a decoy without a bottom, share of the hole's width; the peg may have stood anywhere in it."""
STEP = 0.01
"""Step along the path in which its end is looked for, s. Source: chosen, not measured."""


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


@dataclass(frozen=True, slots=True, eq=False)
class Decoys:
    """The decoys of one search, and the time along its path for which it passes over them."""

    found: tuple[Decoy, ...]
    offset: Vector
    """Offset from the path's point to the lowest point of the peg in the base frame, shape (2,), m."""
    cover: float
    """Time in which the path covers the area once, s; a hole that was taken for a decoy is tried again after it."""
    until: float
    """Time along the path until which the decoys are passed over, s."""

    def with_one(self, decoy: Decoy, time: float) -> "Decoys":
        """Return the decoys with one more, found at a `time` along the path, s."""
        return replace(self, found=(*self.found, decoy), until=time + self.cover)

    def beyond(self, path: Path, time: float) -> float:
        """Return the first time along the path from `time` on at which the peg is outside every decoy, s."""
        while self.found and time < self.until and self._covers(path.at(time)[0] + self.offset):
            time += STEP
        return time

    def _covers(self, lowest: Vector) -> bool:
        return any(math.dist(lowest, decoy.place) < decoy.radius for decoy in self.found)


NOWHERE = Decoys((), np.zeros(2), 0.0, 0.0)
"""Decoys of a plate that has none."""
