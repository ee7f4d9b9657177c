"""Rectangular and square pegs and holes."""

import math
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from drivers.frames import UP, rotation_about
from drivers.part.contract import Face, Part
from drivers.quantities import Vector


@dataclass(frozen=True, slots=True)
class Rectangular(Part):
    """A rectangle; `drivers.part.contract.Part` documents its members."""

    kind: ClassVar[str] = "rectangular"
    a: float
    """Side along the closing axis, m."""
    b: float
    """Side across it, m."""

    @property
    def half(self) -> tuple[float, float]:
        """Half of both sides, m."""
        return self.a / 2, self.b / 2

    @property
    def thickness(self) -> float:
        """First side, m."""
        return self.a

    @property
    def reach(self) -> float:
        """Half the diagonal, m."""
        return math.sqrt(self.a * self.a + self.b * self.b) / 2

    @property
    def symmetry(self) -> float:
        """Half a turn, or a quarter of a turn for a square, rad."""
        return math.pi / 2 if self.a == self.b else math.pi

    @property
    def face(self) -> Face:
        """A plane as wide as the second side."""
        return Face(self.b, is_flat=True)

    def outline(self) -> Vector:
        """Return the four corners."""
        return np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * self.half

    def grown(self, gap: float) -> Self:
        """Return a rectangle with every side moved outwards by `gap`, m."""
        return type(self)(self.a + 2 * gap, self.b + 2 * gap)

    def azimuth(self, direction: float) -> float:
        """Return the azimuth, rad, of the corner towards which the peg is tilted."""
        return direction + math.atan2(self.b, self.a)

    def leaning(self, direction: float, tilt: float) -> tuple[Vector, Vector]:
        """Return the axes of a peg tilted towards a corner.

        That corner enters the hole at any yaw of the hole. If the peg were tilted towards a side, its edge would fit only
        within the clearance.
        """
        lean = self.azimuth(direction)
        turn = rotation_about(np.array([-math.sin(lean), math.cos(lean), 0.0]), tilt)
        return turn @ UP, turn @ np.array([math.cos(direction), math.sin(direction), 0.0])

    def lowest(self, tip: Vector, axis: Vector, closing: Vector) -> Vector:
        """Return the lowest corner, shape (3,), m."""
        beside = np.cross(axis, closing)
        across = self.b / self.a * math.copysign(1.0, beside[2]) * beside
        corner: Vector = tip - self.a / 2 * (math.copysign(1.0, closing[2]) * closing + across)
        return corner
