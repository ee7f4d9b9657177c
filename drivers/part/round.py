"""Round pegs and holes."""

import math
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from drivers.frames import UP
from drivers.part.contract import Face, Part
from drivers.quantities import Vector

CORNERS = 96
"""Number of corners of the polygon that is drawn for the circle."""


@dataclass(frozen=True, slots=True)
class Round(Part):
    """A circle; `drivers.part.contract.Part` documents its members."""

    kind: ClassVar[str] = "round"
    symmetry: ClassVar[float] = 0.0
    diameter: float
    """Diameter of the circle, m."""
    chamfer: float = 0.0
    """Width and height of a chamfer of 45 degrees, m: at a peg's end or at a hole's mouth."""

    @property
    def half(self) -> tuple[float, float]:
        """Radius along both axes, m."""
        return self.reach, self.reach

    @property
    def thickness(self) -> float:
        """Diameter, m."""
        return self.diameter

    @property
    def reach(self) -> float:
        """Radius, m."""
        return self.diameter / 2

    @property
    def face(self) -> Face:
        """The line along which a cylinder touches the pads."""
        return Face(self.diameter, is_flat=False)

    def outline(self) -> Vector:
        """Return `CORNERS` points on the circle, m."""
        angle = 2.0 * math.pi * np.arange(CORNERS) / CORNERS
        return self.reach * np.column_stack([np.cos(angle), np.sin(angle)])

    def grown(self, gap: float) -> Self:
        """Return a circle whose radius is larger by `gap`, m, without a chamfer."""
        return type(self)(self.diameter + 2 * gap)

    def azimuth(self, direction: float) -> float:
        """Return the azimuth, rad, of the closing axis; a round peg is tilted in the vertical plane of this axis."""
        return direction

    def leaning(self, direction: float, tilt: float) -> tuple[Vector, Vector]:
        """Return the axes of a peg tilted in the plane of its closing axis.

        The closing axis then has a component along the surface's normal: the back of a finger faces the surface,
        [gibbons], Sec. IV.
        """
        lean = np.array([math.cos(direction), math.sin(direction), 0.0])
        axis = math.sin(tilt) * lean + math.cos(tilt) * UP
        closing = math.cos(tilt) * lean - math.sin(tilt) * UP
        return axis, closing

    def lowest(self, tip: Vector, axis: Vector, closing: Vector) -> Vector:
        """Return the lowest point of the rim, shape (3,), m; the middle of the end if the peg is upright.

        A chamfered peg has two rims; the upper one is lower if the peg leans by more than 45 degrees.
        """
        down = axis[2] * axis - UP
        size = math.sqrt(float(down @ down))
        if size <= 1e-9:
            return tip
        point: Vector = tip + ((self.reach - self.chamfer) / size) * down
        if self.chamfer > 0.0 and size > axis[2]:
            point = tip + self.chamfer * axis + (self.reach / size) * down
        return point
