"""Positions of the taxels of a finger: geometry as data, shared by skills and simulation.

Number, places and modules of the taxels belong to the skin. Two layouts ship; any other is a file of figures, `SkinLayout`.
In the shipped layouts a finger has two modules: triangles with rows of 4, 3, 2 and 1 taxels, 7.5 mm apart ([gibbons],
Sec. VI). The arrangement of the two modules in the finger is not published, so there are two layouts. Both fingers are the
same part, but one finger is rotated by half a turn about x. In the finger frame the left finger is therefore the mirror
image of the right finger about the x axis; the flip of [gibbons], Eq. (1), removes the mirroring.
"""

from functools import lru_cache
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, ValidationInfo, model_validator
from pydantic_core import PydanticKnownError

from drivers.config_model import ConfigModel, beside_config
from drivers.figures_file import read_figures
from drivers.quantities import FINGERS, Vector

A = TypeVar("A", bound=NDArray[Any])
PITCH = 7.5e-3
"""Distance between neighbouring taxels of the shipped layouts, m; [gibbons], Sec. VI."""
ROW = PITCH * 0.75**0.5
"""Distance between neighbouring rows of a triangle, m."""
SOFTEST_SHEAR, STIFFEST_SHEAR = 5e3, 5e4
"""Stiffness of both pads in their plane under the closed grip, N/m, in the softest and in the stiffest skin; assumed. The
stiffest skin is rubber with a shear modulus of 60 kPa: an 8 mm peg covers 180 mm² of each pad, and leaves 0.4 mm of rubber.
"""
MODULE_TAXELS = 10
"""Number of taxels of one module of the shipped layouts."""

Coordinate = Annotated[float, Field(ge=-0.1, le=0.1)]
PadSide = Annotated[float, Field(gt=0.0, le=0.2)]


class SkinLayout(ConfigModel):
    """Taxels of one finger; both fingers are the same part."""

    places: Annotated[tuple[tuple[Coordinate, Coordinate], ...], Field(min_length=3)]
    """Places of the right finger's taxels in the order of their readings, m. The finger's centre is the origin, x points along
    the finger to its end, y across it. The left finger is the mirror image about the x axis.
    """
    pad: tuple[PadSide, PadSide]
    """Length (along x) and width (along y) of the rubber that can touch a peg, m."""
    full_scale: Annotated[float, Field(gt=0.0, le=65_535.0)]
    """Largest reading under a firm touch, counts."""
    noise: Annotated[float, Field(gt=0.0, lt=0.2)]
    """Standard deviation of a reading, with what the model of the pads leaves unexplained, fraction of `full_scale`."""
    beside: Annotated[float, Field(gt=0.0, lt=1.0)]
    """Largest reading of the least pressed fifth of a finger's taxels while the hand holds a peg, fraction of `full_scale`; if it is
    exceeded, the finger has an offset.
    """
    modules: Annotated[int, Field(ge=1)] = 1
    """Number of modules of a finger: equal parts of `places` in their order, each with a plug of its own. If there are two, the second
    must be the image of the first by half a turn about the centre.
    """

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        if len(self.places) % self.modules:
            raise ValueError(f"places: {len(self.places)}; a multiple of modules = {self.modules} allowed")
        return self


def _shipped(module: Vector) -> SkinLayout:
    """Return the layout of a module and its image by half a turn about the centre.

    Along the finger, the rubber ends at the outermost taxels; across the finger, it ends half a lattice spacing beyond them.
    Its size is 41 x 26 mm for the parallelogram, 47 x 26 mm base to base.
    """
    both = np.concatenate([module, -module])
    x, y = both.T
    spacing = np.diff(np.unique(y.round(9))).min()
    return SkinLayout(
        places=tuple((float(x), float(y)) for x, y in both),
        pad=(float(np.ptp(x)), float(np.ptp(y) + spacing)),
        full_scale=20_000.0,  # [cyskin], highest touch peak
        noise=0.015,
        beside=0.075,  # below 0.026 with round and flat pegs of 8 and 12 mm at 30 and 70 N, on the pads of the simulation
        modules=2,
    )


_PLACE, _ROW = np.array([(place, row) for row in range(4) for place in range(4 - row)], dtype=float).T
LAYOUTS: dict[str, SkinLayout] = {
    "parallelogram": _shipped(np.column_stack([(_PLACE - 2.0) * PITCH + (_ROW - 1.5) * PITCH / 2, (_ROW - 1.5) * ROW])),
    # Distance between the facing rows of the layout `base_to_base`, m.
    "base_to_base": _shipped(np.column_stack([7.6e-3 / 2 + _ROW * ROW, (_PLACE - (3.0 - _ROW) / 2) * PITCH])),
}
"""Layouts that ship with the program, by name."""


def _known(name: str, info: ValidationInfo) -> str:
    if name.endswith(".toml"):
        return str(beside_config(Path(name), info))
    if name not in LAYOUTS:
        raise PydanticKnownError("literal_error", {"expected": " or ".join(f"'{known}'" for known in LAYOUTS)})
    return name


Layout = Annotated[str, AfterValidator(_known)]
"""Name of a layout that ships with the program, or a file of a `SkinLayout`, `*.toml`, relative to the folder of the config file."""


@lru_cache
def layout_of(layout: Layout) -> SkinLayout:
    """Return the layout of this name or file.

    Raises:
        ConfigError: The file cannot be read, or its figures violate the model.
    """
    return LAYOUTS.get(layout) or read_figures(Path(layout), SkinLayout, "layout")


def shape_of(layout: Layout) -> tuple[int, int]:
    """Return the shape (2, n) of a frame: fingers and taxels of each."""
    return FINGERS, len(layout_of(layout).places)


def fixed(array: A) -> A:
    """Make an array read-only, so that callers can share it, and return it."""
    array.flags.writeable = False
    return array


@lru_cache
def module_of(layout: Layout) -> NDArray[np.intp]:
    """Return the module number of each taxel, counted over both fingers, left finger first, shape (2, n)."""
    fingers, taxels = shape_of(layout)
    modules = fingers * layout_of(layout).modules
    return fixed(np.repeat(np.arange(modules), fingers * taxels // modules).reshape(fingers, taxels))


def _exchanged(layout: Layout, modules_of: tuple[int, ...], *, fingers: bool = False) -> NDArray[np.intp]:
    """Return the source taxel of each reading, shape (2 n,), after exchanges of the modules of some fingers, then of the fingers."""
    shape = shape_of(layout)
    told = np.arange(shape[0] * shape[1]).reshape(shape)
    for finger in modules_of:
        told[finger] = np.roll(told[finger], shape[1] // 2)
    return fixed(told[::-1].ravel() if fingers else told.ravel())


@lru_cache
def module_exchanges(layout: Layout) -> dict[str, NDArray[np.intp]]:
    """Return the possible exchanges of modules, by name: the source taxel of each reading, shape (2 n,).

    The result is empty unless a finger has two modules.
    """
    if layout_of(layout).modules != 2:
        return {}
    return {
        "the two modules of the left finger": _exchanged(layout, (0,)),
        "the two modules of the right finger": _exchanged(layout, (1,)),
        "the two modules of each finger": _exchanged(layout, (0, 1)),
    }


@lru_cache
def exchanges(layout: Layout) -> dict[str, NDArray[np.intp]]:
    """Return the possible exchanges of modules and fingers, as `module_exchanges` does.

    An exchange of the fingers mirrors the print of a peg; the print alone does not show this.
    """
    found = module_exchanges(layout) | {"the two fingers": _exchanged(layout, (), fingers=True)}
    if layout_of(layout).modules == 2:
        found["the two fingers and the modules of each"] = _exchanged(layout, (0, 1), fingers=True)
    return found


@lru_cache
def positions(layout: Layout) -> Vector:
    """Return the places of the right finger's taxels, shape (n, 2), m, x and y of the finger frame."""
    return fixed(np.array(layout_of(layout).places))


@lru_cache
def finger_positions(layout: Layout) -> Vector:
    """Return the places of all taxels, left finger first, shape (2, n, 2), m, x and y of the finger frame."""
    right = positions(layout)
    return fixed(np.stack([right * [1.0, -1.0], right]))


@lru_cache
def triangles(layout: Layout) -> NDArray[np.intp]:
    """Return the Delaunay triangles of one finger's taxels, shape (n, 3), indices of taxels.

    A triangle is Delaunay if no taxel lies inside its circumcircle. In the rectangles between facing rows both diagonals
    are possible; a shear of a millionth selects one.
    """
    x, y = positions(layout).T / PITCH
    x = x + 1e-6 * y
    corner = np.array(list(combinations(range(len(x)), 3)))
    a, b, c = corner.T
    doubled_area = (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a])
    wide = np.abs(doubled_area) > 1e-3
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
    return fixed(corner[is_empty])


def pad_size(layout: Layout) -> tuple[float, float]:
    """Return length (along x) and width (along y) of the rubber that can touch a peg, m."""
    return layout_of(layout).pad
