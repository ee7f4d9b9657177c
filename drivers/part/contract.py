"""The properties of a part's cross-section; `round` and `rectangular` complete them."""

import math
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from drivers.quantities import Vector


@dataclass(frozen=True, slots=True)
class Face:
    """The surface of a part that the pads of the hand touch."""

    width: float
    """Width of a flat face, or diameter of a cylinder, m."""
    is_flat: bool
    """True if the pads touch a plane, False if they touch a cylinder along a line."""

    @property
    def flat_width(self) -> float:
        """Width of the plane that lies on a pad, m; 0 for a cylinder, because it touches along a line."""
        return self.width if self.is_flat else 0.0

    def groove(self, indentation: float) -> tuple[Vector, Vector]:
        """Return the lines that represent the load across the peg's axis: their distances from the axis and their shares of
        the load.

        A cylinder leaves a groove with the parabolic load of a bed of springs. The groove's half width is the square root of
        width times depth. Three lines reproduce that load exactly up to its fifth moment. All lines of a plane carry the same
        load, see `strips`.

        Args:
            indentation: Depth of the groove, m.

        Returns:
            Distances from the axis, m, and shares that add up to 1; both of shape (n,).
        """
        if self.is_flat:
            return np.zeros(1), np.ones(1)
        half = math.sqrt(self.width * indentation)
        return half * math.sqrt(3.0 / 7.0) * np.array([-1.0, 0.0, 1.0]), np.array([7.0, 16.0, 7.0]) / 30.0

    def profile(self, beside: Vector) -> Vector:
        """Return the distance of the surface from its tangent plane, m, at distances from the axis, m.

        The distance is infinite beside a flat face, and at points of a cylinder that are too steep for a pad to follow.
        """
        if self.is_flat:
            return np.where(np.abs(beside) <= self.width / 2, 0.0, np.inf)
        radius = self.width / 2
        sunk = radius - np.sqrt(np.maximum(radius**2 - beside**2, 0.0))
        # Distance from a cylinder's axis up to which a pad follows it, fraction of the radius; the slope is 64 degrees.
        return np.where(np.abs(beside) < 0.9 * radius, sunk, np.inf)

    def strips(self, step: float) -> Vector:
        """Return the shares of the load on an odd number of lines `step`, m, apart, by the trapezoidal rule; they add up to 1.

        A cylinder has one line; `groove` spreads its load.
        """
        if not self.is_flat:
            return np.ones(1)
        shares = np.ones(2 * max(1, round(self.width / 2 / step)) + 1)
        shares[[0, -1]] = 0.5
        shares /= shares.sum()
        return shares


class Part(Protocol):
    """The cross-section of a peg or of a hole; two sections of one kind can be compared.

    The hand holds a peg between two faces. The closing axis, along which the fingers move, is the section's first
    axis; the second axis is normal to it. All lengths are in m.
    """

    def __hash__(self) -> int:
        return hash(self.kind)  # each section is a dataclass and replaces this by a hash of its sizes

    @property
    def kind(self) -> str:
        """Name of the kind, by which skills and simulation select their handling of such parts."""

    @property
    def half(self) -> tuple[float, float]:
        """Half the extents along the closing axis and across it, m."""

    @property
    def thickness(self) -> float:
        """Distance between the pads that hold the peg, m."""

    @property
    def inscribed(self) -> float:
        """Diameter of the largest circle inside the section, m."""
        return 2.0 * min(self.half)

    @property
    def widest(self) -> float:
        """Larger extent of the section along one of its two axes, m."""
        return 2.0 * max(self.half)

    @property
    def reach(self) -> float:
        """Radius of the smallest circle about the section, m."""

    @property
    def chamfer(self) -> float:
        """Width and height of a chamfer of 45 degrees, m: at a peg's end or at a hole's mouth; 0 if there is none."""
        return 0.0

    @property
    def symmetry(self) -> float:
        """Smallest turn about the peg's axis that leaves the section unchanged, rad; 0 if every turn does."""

    def least_turn(self, turn: float) -> float:
        """Return the smallest turn about the peg's axis, rad, >= 0, that is equivalent to `turn`, rad."""
        return turn % self.symmetry if self.symmetry > 0.0 else 0.0

    @property
    def face(self) -> Face:
        """The surface that the pads touch."""

    def outline(self) -> Vector:
        """Return the corners of the section, or of a polygon in place of a curved one, m, counter-clockwise, shape (n, 2)."""

    def grown(self, gap: float) -> Self:
        """Return the section of a hole around this one with a gap of this width, m, on every side."""

    def clearance(self, hole: Self) -> float:
        """Return the gap on every side of this peg in the middle of its hole, m; the smallest if the sides differ."""
        return min(around - own for around, own in zip(hole.half, self.half, strict=True))

    def azimuth(self, direction: float) -> float:
        """Return the azimuth, rad, of the section's leading point when the peg is tilted.

        Args:
            direction: Azimuth of the closing axis while the peg is upright, rad.
        """

    def leaning(self, direction: float, tilt: float) -> tuple[Vector, Vector]:
        """Return the axis and the closing axis, both unit, shape (3,), of a peg tilted towards its leading point.

        Args:
            direction: Azimuth of the closing axis while the peg is upright, rad.
            tilt: Angle to the vertical, rad.
        """

    def lowest(self, tip: Vector, axis: Vector, closing: Vector) -> Vector:
        """Return the lowest point of the peg's end, shape (3,), m.

        Args:
            tip: Middle of the end face, shape (3,), m.
            axis: Axis of the peg, unit, upwards, shape (3,).
            closing: Closing axis of the hand, unit, shape (3,).
        """
