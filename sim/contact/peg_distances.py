"""Distances of the peg from the hole's edge, the hole's mouth and the pads, compiled."""

import math
from typing import NamedTuple

from drivers.compiled import njit
from drivers.quantities import Vector

FAR = 0.003
"""Distance from the hole's edge, m; the peg is far if every point of its end is beyond it. In 1 ms the end moves less than
a tenth of this distance."""


class PegView(NamedTuple):
    """Size and present pose of the peg."""

    size: Vector
    """Radius and half the length, m."""
    middle: Vector
    """View of the peg's centre, shape (3,), m, base frame."""
    axes: Vector
    """View of the peg's axes, shape (3, 3), z from its end upward."""


@njit(cache=True)
def is_far(hole: Vector, size: Vector, middle: Vector, axes: Vector) -> bool:  # pragma: no cover
    """Return True if every point of the peg's end is `FAR` from the hole's edge, sideways or above.

    Args:
        hole: Centre of the mouth, m; outward axis; radius, m: shape (7,), base frame.
        size: Radius and half the length of the peg, m.
        middle: Centre of the peg, shape (3,), m, base frame.
        axes: Axes of the peg, shape (3, 3), z from its end upward.
    """
    height, square, along = 0.0, 0.0, 0.0
    for k in range(3):
        way = middle[k] - size[1] * axes[k, 2] - hole[k]
        height += way * hole[3 + k]
        square += way * way
        along += axes[k, 2] * hole[3 + k]
    beside = math.sqrt(max(square - height * height, 0.0))
    lowest = height - size[0] * math.sqrt(max(1.0 - along * along, 0.0))
    return bool(beside > hole[6] + size[0] + FAR or lowest > FAR)


@njit(cache=True)
def pad_gap(
    pads: tuple[int, int], sizes: Vector, places: Vector, axes: Vector, peg: PegView
) -> float:  # pragma: no cover
    """Return a lower bound of the distance between the pads and the peg, m; negative if contact is possible.

    Args:
        pads: Indices of the pads' geoms, which are boxes.
        sizes: Half the extents of all geoms, shape (n, 3), m.
        places: Centres of all geoms, shape (n, 3), m, base frame.
        axes: Axes of all geoms, shape (n, 9).
        peg: Size and pose of the peg.
    """
    size, middle, turned = peg.size, peg.middle, peg.axes
    least = math.inf
    for pad in pads:
        gap = -math.inf
        for k in range(3):
            away = along = 0.0
            for i in range(3):
                away += axes[pad, 3 * i + k] * (middle[i] - places[pad, i])
                along += axes[pad, 3 * i + k] * turned[i, 2]
            extent = size[1] * abs(along) + size[0] * math.sqrt(max(1.0 - along * along, 0.0))
            gap = max(gap, abs(away) - extent - sizes[pad, k])
        least = min(least, gap)
    return least


@njit(cache=True)
def below_mouth(
    half: float, middle: Vector, axes: Vector, mouth: Vector, plate: Vector
) -> tuple[float, float]:  # pragma: no cover
    """Return the depth of the centre of a peg's end below a hole's mouth, and its distance from the hole's axis, m.

    Args:
        half: Half the length of the peg, m.
        middle: Centre of the peg, shape (3,), m, base frame.
        axes: Axes of the peg, shape (3, 3), z from its end upward.
        mouth: Centre of the hole's mouth, shape (3,), m, base frame.
        plate: Axes of the plate, shape (3, 3), z outward.
    """
    x = middle[0] - half * axes[0, 2] - mouth[0]
    y = middle[1] - half * axes[1, 2] - mouth[1]
    z = middle[2] - half * axes[2, 2] - mouth[2]
    across = plate[0, 0] * x + plate[1, 0] * y + plate[2, 0] * z
    along = plate[0, 1] * x + plate[1, 1] * y + plate[2, 1] * z
    return -(plate[0, 2] * x + plate[1, 2] * y + plate[2, 2] * z), math.hypot(across, along)
