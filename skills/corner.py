"""The end of a square peg, where a corner leads as a round one's edge does; pure.

Leaning about a diagonal, a square peg puts one corner into the hole however the hole is turned: the edge of a peg that leans
about a side fits only within the clearance.
"""

import math

import numpy as np

from drivers.frames import UP, rotation_about
from drivers.quantities import Vector

DIAGONAL = math.pi / 4
"""From the closing axis, which is normal to two faces, to the corner that leads, rad."""


def corner_ahead(direction: float, tilt: float) -> tuple[Vector, Vector]:
    """Return axis and closing axis of a square peg that leans over one of its corners, both unit, shape (3,).

    Args:
        direction: Azimuth of the closing axis while the peg is upright, rad; it leans towards `DIAGONAL` more.
        tilt: Angle to the vertical, rad.
    """
    lean = direction + DIAGONAL
    turn = rotation_about(np.array([-math.sin(lean), math.cos(lean), 0.0]), tilt)
    return turn @ UP, turn @ np.array([math.cos(direction), math.sin(direction), 0.0])


def lowest_corner(tip: Vector, axis: Vector, closing: Vector, side: float) -> Vector:
    """Return the lowest corner of a square peg's end, shape (3,), m.

    Args:
        tip: Middle of the end face, shape (3,), m.
        axis: Of the peg, unit, upwards, shape (3,).
        closing: Closing axis of the hand, unit, normal to two of the peg's faces, shape (3,).
        side: Of the peg, m.
    """
    beside = np.cross(axis, closing)
    corner: Vector = tip - side / 2 * (
        math.copysign(1.0, closing[2]) * closing + math.copysign(1.0, beside[2]) * beside
    )
    return corner
