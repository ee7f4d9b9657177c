"""Positions of the taxels of a finger: geometry as data, shared by skills and simulation.

A finger has two modules, triangles of 4-3-2-1 taxels at 7.5 mm ([gibbons], Sec. VI). The arrangement of the two in the
finger is not published, so there are two layouts. Both fingers are the same part, one of them turned half a turn
about x. In the finger frame the left one is therefore the mirror image of the right one about the x axis; the flip of
[gibbons], Eq. (1), removes the mirroring.
"""

from functools import lru_cache
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from drivers.quantities import FINGERS, TAXELS, Vector

Layout = Literal["parallelogram", "base_to_base"]
LAYOUTS: tuple[Layout, ...] = ("parallelogram", "base_to_base")

PITCH = 7.5e-3
"""Distance between neighbouring taxels, m; [gibbons], Sec. VI."""
ROW = PITCH * 0.75**0.5
"""Distance between neighbouring rows of a triangle, m."""
GAP = 7.6e-3
"""Distance between the facing rows of the layout `base_to_base`, m."""
MODULE_TAXELS = 10
"""Number of taxels of one module."""
MODULES = TAXELS // MODULE_TAXELS
"""Number of modules of one finger."""
MODULE_OF = np.repeat(np.arange(FINGERS * MODULES), MODULE_TAXELS).reshape(FINGERS, TAXELS)
"""Module number of each taxel, left finger first, shape (2, 20)."""
MODULE_OF.flags.writeable = False


def _exchanged(*, left: bool, right: bool, fingers: bool) -> NDArray[np.intp]:
    """Return the source taxel of each reading, shape (40,), after exchanges of a finger's modules and then of the fingers."""
    told = np.arange(FINGERS * TAXELS).reshape(FINGERS, TAXELS)
    for finger, is_exchanged in enumerate((left, right)):
        if is_exchanged:
            told[finger] = np.roll(told[finger], MODULE_TAXELS)
    order: NDArray[np.intp] = told[::-1].ravel() if fingers else told.ravel()
    order.flags.writeable = False
    return order


MODULE_EXCHANGES = {
    "the two modules of the left finger": _exchanged(left=True, right=False, fingers=False),
    "the two modules of the right finger": _exchanged(left=False, right=True, fingers=False),
    "the two modules of each finger": _exchanged(left=True, right=True, fingers=False),
}
"""Possible exchanges of modules, by name: the source taxel of each reading, shape (40,)."""
EXCHANGES = MODULE_EXCHANGES | {
    "the two fingers": _exchanged(left=False, right=False, fingers=True),
    "the two fingers and the modules of each": _exchanged(left=True, right=True, fingers=True),
}
"""Possible exchanges of modules and fingers. If the fingers are exchanged, a print is mirrored; the print alone cannot show it."""

_SHEAR = 1e-6
_FLAT = 1e-3


@lru_cache
def positions(layout: Layout) -> Vector:
    """Return the places of the right finger's taxels, shape (20, 2), m, x and y of the finger frame.

    The finger's centre is the origin, x points along the finger to its end, y across it. Module 0 comes
    first; module 1 is its image by half a turn about the centre.
    """
    rows = [(place, row) for row in range(4) for place in range(4 - row)]
    place, row = np.array(rows, dtype=float).T
    if layout == "parallelogram":
        module = np.column_stack([(place - 2.0) * PITCH + (row - 1.5) * PITCH / 2, (row - 1.5) * ROW])
    else:
        module = np.column_stack([GAP / 2 + row * ROW, (place - (3.0 - row) / 2) * PITCH])
    both = np.concatenate([module, -module])
    both.flags.writeable = False
    return both


@lru_cache
def finger_positions(layout: Layout) -> Vector:
    """Return the places of all taxels, left finger first, shape (2, 20, 2), m, x and y of the finger frame."""
    right = positions(layout)
    both = np.stack([right * [1.0, -1.0], right])
    both.flags.writeable = False
    return both


@lru_cache
def triangles(layout: Layout) -> NDArray[np.intp]:
    """Return the Delaunay triangles of one finger's taxels, shape (n, 3), indices of taxels.

    A triangle is Delaunay if no taxel lies inside its circumcircle. In the rectangles between facing rows both diagonals
    are possible; a shear of a millionth selects one.
    """
    x, y = positions(layout).T / PITCH
    x = x + _SHEAR * y
    corner = np.array(list(combinations(range(TAXELS), 3)))
    a, b, c = corner.T
    doubled_area = (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a])
    wide = np.abs(doubled_area) > _FLAT
    corner, doubled_area = corner[wide], doubled_area[wide]
    a, b, c = corner.T
    # With every point lifted to the paraboloid, inside the circumcircle means below the plane of the three corners.
    power = x**2 + y**2
    edge = np.stack([np.stack([v[k] - v[a] for v in (x, y, power)]) for k in (b, c)])
    normal = np.cross(edge[0].T, edge[1].T) * np.sign(doubled_area)[:, None]
    lifted = np.column_stack([x, y, power])
    above = np.einsum("tk,tpk->tp", normal, lifted[None] - lifted[a][:, None])
    above[np.arange(len(corner))[:, None], corner] = 0.0
    is_empty = (above >= -1e-12).all(axis=1)
    chosen: NDArray[np.intp] = corner[is_empty]
    chosen.flags.writeable = False
    return chosen


def pad_size(layout: Layout) -> tuple[float, float]:
    """Return length (along x) and width (along y) of the rubber that can touch a peg, m.

    It ends at the outermost taxels along the finger and half a lattice spacing beyond them across it:
    41 x 26 mm for the parallelogram, 47 x 26 mm base to base.
    """
    x, y = positions(layout).T
    spacing = np.diff(np.unique(y.round(9))).min()
    return float(np.ptp(x)), float(np.ptp(y) + spacing)
