"""Model of the taxels' readings for a peg at any angle and offset, in closed form; estimators compare frames with it.

The peg presses a line into each pad. The line's load per metre is a constant plus a part that rises along the peg. Across
the line, the groove has the parabolic pressure of a bed of springs. The elastomer blurs the pressure with a Gaussian, and
a taxel averages it over its disc. Along the line, the blurred load is a difference of error functions; the averages over
disc and groove are small sums. A peg with flat sides presses a face, modelled as the mean of parallel lines.
"""

import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.config_model import ConfigModel, Figure, Source
from drivers.parts import Peg
from drivers.quantities import FINGERS, Vector
from drivers.skin.layout import Layout, finger_positions, pad_size

MOST_THREADS = 8
"""Largest number of threads for filling the tables."""


class TemplateParams(ConfigModel):
    """Properties of the pad, from its maker's data; those of the simulated pad can differ."""

    SOURCE: ClassVar[str] = "chosen on simulated pads, its effect measured by `cell study tactile`"

    blur: Annotated[float, Figure("m"), Field(exclude=True), Source("assumed")] = 1.2e-3
    """Standard deviation of the point spread of 1 mm of elastomer, m; assumed, about the thickness."""
    taxel_diameter: Annotated[float, Figure("m"), Field(exclude=True), Source("assumed")] = 4e-3
    """Diameter of the sensitive disc of one taxel, m; assumed, about half the pitch."""
    indentation: Annotated[float, Figure("m"), Field(exclude=True)] = 8.5e-4
    """Depth of the groove under a usual grip, m; half the groove is then 2.6 mm wide under a diameter of 8 mm."""
    theta_step: Annotated[float, Figure("rad"), Field(exclude=True)] = math.pi / 360
    """Angle between neighbouring templates, rad."""
    offset_step: Annotated[float, Figure("m"), Field(exclude=True)] = 2.5e-4
    """Offset between neighbouring templates, m."""
    offset_reach: Annotated[float, Figure("m"), Field(exclude=True), Source("docs/tried/angle.md")] = 1e-2
    """Largest distance of the peg's axis from the finger centre, m; beyond it the print of an 8 mm peg leaves the pad."""

    def broader(self, factor: float) -> Self:
        """Return the pad with prints broader by `factor`, in both point spread and groove."""
        # The half-width of a groove of depth d under a radius r is sqrt(2 r d): d grows with factor².
        return self.model_copy(update={"blur": factor * self.blur, "indentation": factor**2 * self.indentation})


COARSE_THETA, COARSE_OFFSET = 5, 4
"""Steps of the coarse search along angle and offset, in steps of the templates."""


@dataclass(frozen=True, slots=True, eq=False)
class Templates:
    """Readings of every taxel for all angles and offsets of one grid, for one print or several."""

    theta: Vector
    """Angles, shape (n,), rad, increasing from -pi/2, evenly spaced over half a turn."""
    offset: Vector
    """Offsets, shape (m,), m, evenly spaced about 0."""
    even: NDArray[np.float32]
    """Readings for a load of 1 along the whole peg, shape (p, n, m, 2 taxels); unit: the reading under an infinitely long peg."""
    rising: NDArray[np.float32]
    """Readings for a load that rises from 0 at the finger centre to 1 at `HALF_LINE` towards the tip, shape (p, n, m, 2 taxels)."""
    along: NDArray[np.float32]
    """Positions of the taxels along the peg, from the finger centre towards the tip, in units of `HALF_LINE`, shape (n, 2 taxels)."""
    borne: NDArray[np.float32]
    """Total load of one pad for the loads of `even` and of `rising`, shape (p, n, m, 2), m."""
    coarse: tuple[NDArray[np.float32], ...] = ()
    """Copies of `even`, `rising` and `borne` at the coarse steps, including the middle offset.

    The copies fit in the processor's cache; the whole tables take a hundred megabytes.
    """

    def __post_init__(self) -> None:
        """Copy the coarse steps and make all arrays read-only, because estimators share the tables."""
        if not self.coarse:
            first = self.offset.size // 2 % COARSE_OFFSET
            tables = (self.even, self.rising, self.borne)
            copies = tuple(np.ascontiguousarray(table[:, ::COARSE_THETA, first::COARSE_OFFSET]) for table in tables)
            object.__setattr__(self, "coarse", copies)
        for array in (self.theta, self.offset, self.even, self.rising, self.along, self.borne):
            array.flags.writeable = False
        for table in self.coarse:
            table.flags.writeable = False

    def part(self, first: int, last: int) -> "Templates":
        """Return the prints from `first` to before `last`; the result shares the tables."""
        even, rising, borne = (table[first:last] for table in (self.even, self.rising, self.borne))
        coarse = tuple(table[first:last] for table in self.coarse)
        return Templates(self.theta, self.offset, even, rising, self.along, borne, coarse)


def make_templates(layout: Layout, peg: Peg, params: TemplateParams) -> Templates:
    """Return the templates of a peg held with its stated overhang, p = 1; the first call takes a fraction of a second."""
    return reaching_templates(layout, peg, params, (peg.overhang,))


@lru_cache(maxsize=2)
def broad_templates(layout: Layout, peg: Peg, params: TemplateParams, factors: tuple[float, ...]) -> Templates:
    """Return the templates of prints that are broader by each of `factors`, p = the number of factors."""
    made = [_make(layout, peg, params.broader(factor), (peg.overhang,)) for factor in factors]
    even, rising, borne = (
        np.concatenate([getattr(each, table) for each in made]) for table in ("even", "rising", "borne")
    )
    return Templates(made[0].theta, made[0].offset, even, rising, made[0].along, borne)


@lru_cache(maxsize=4)
def reaching_templates(layout: Layout, peg: Peg, params: TemplateParams, overhangs: tuple[float, ...]) -> Templates:
    """Return the templates of pegs with each of `overhangs`, m, instead of `peg.overhang`."""
    return _make(layout, peg, params, overhangs)


def _make(layout: Layout, peg: Peg, params: TemplateParams, overhangs: tuple[float, ...]) -> Templates:
    from skills.tactile.template_fill import fill  # imports the compiler, which only a comparison of frames needs

    half = math.pi / 2
    count = max(4, 4 * round(math.pi / params.theta_step / 4))
    theta = np.arange(count, dtype=np.float64) * (math.pi / count) - half
    side = round(params.offset_reach / params.offset_step)
    offset = np.arange(-side, side + 1, dtype=np.float64) * params.offset_step
    length, width = pad_size(layout)
    # Seven-point rule on a disc of radius R, exact for polynomials up to degree 5:
    # weight 1/4 at the centre, 1/8 at six points on the radius R sqrt(2/3).
    turn = np.arange(6) * math.pi / 3
    reach = params.taxel_diameter / 2 * math.sqrt(2.0 / 3.0)
    disc = np.concatenate([[[0.0, 0.0]], reach * np.column_stack([np.cos(turn), np.sin(turn)])])
    disc_weights = np.array([0.25] + [0.125] * 6)
    groove, groove_weights = peg.part.face.groove(params.indentation)
    face = peg.part.face.strips(params.offset_step)
    lines = np.arange(-(side + face.size // 2), side + face.size // 2 + 1, dtype=np.float64) * params.offset_step
    taxels = np.array(finger_positions(layout)[1])  # a writable copy, of the same compiled type as the taxels below
    falling = np.argsort(overhangs)[::-1]
    backs = np.array(overhangs)[falling]
    arguments = (disc, disc_weights, groove, groove_weights, params.blur)
    pad = (length / 2, width / 2, peg.length, backs)
    right, left = (
        np.zeros((2, backs.size, theta.size, lines.size, taxels.shape[0])),
        np.zeros((2, backs.size, 1, lines.size, taxels.shape[0])),
    )
    # Each angle fills its own row, so threads can share the work.
    bounds = np.linspace(0, theta.size, min(os.cpu_count() or 1, MOST_THREADS) + 1).astype(int).tolist()

    def fill_rows(first: int, last: int) -> None:
        fill(theta, lines, taxels, *pad, *arguments, *right, first, last)

    with ThreadPoolExecutor() as threads:
        list(threads.map(fill_rows, bounds[:-1], bounds[1:]))
    # The left finger is the mirror image of the right one about the finger's axis.
    fill(-theta[:1], lines, taxels, *pad, *arguments, *left, 0, 1)
    under = np.zeros((2, 1, 1, face.size, 1))
    middle = lines[lines.size // 2 - face.size // 2 :][: face.size]
    fill(np.zeros(1), middle, np.zeros((1, 2)), 0.1, 0.1, 0.1, np.array([0.1]), *arguments, *under, 0, 1)
    whole = float(face @ under[0, 0, 0, :, 0])
    tables = np.empty((2, backs.size, theta.size, offset.size, FINGERS * taxels.shape[0]), np.float32)
    number = taxels.shape[0]
    for load in range(2):
        for place, own in enumerate(falling):
            made = _beside(right[load, place], face, whole)
            tables[load, own, ..., number:] = made
            tables[load, own, 1:, :, :number] = made[:0:-1, ::-1]
            tables[load, own, 0, :, :number] = _beside(left[load, place], face, whole)[0, ::-1]
    borne = _borne(theta, offset, (length / 2, width / 2), peg.length, overhangs)
    even, rising = tables
    return Templates(theta, offset, even, rising, _along(theta, layout), borne)


def _along(theta: Vector, layout: Layout) -> NDArray[np.float32]:
    """Return the taxels' positions along the peg, see `Templates.along`, for angles `theta`, shape (n,), rad."""
    from skills.tactile.template_fill import HALF_LINE  # imports the compiler as well

    # along = x cos(theta) + y sin(theta)
    along = np.column_stack([np.cos(theta), np.sin(theta)]) @ finger_positions(layout).reshape(-1, 2).T
    return (along / HALF_LINE).astype(np.float32)


def _borne(
    theta: Vector, offset: Vector, half: tuple[float, float], tip: float, overhangs: tuple[float, ...]
) -> NDArray[np.float32]:
    """Return the total load of one pad for the two loads along the peg's axis, see `Templates.borne`.

    Args:
        theta: Angles, shape (n,), rad.
        offset: Offsets, shape (m,), m.
        half: Half the length and half the width of a pad, m.
        tip: Length of the peg from the finger centre to its tip, m.
        overhangs: Lengths of the peg beyond the finger centre, inside the hand, shape (p,), m.
    """
    from skills.tactile.template_fill import HALF_LINE  # imports the compiler as well

    c, s = np.cos(theta)[:, None], np.sin(theta)[:, None]
    low = -np.array(overhangs)[:, None, None]
    high = np.full_like(low, tip)
    for start, step, edge in ((-offset * s, c, half[0]), (offset * c, s, half[1])):
        along = np.where(np.abs(step) < 1e-9, 1e-9, step)
        low = np.maximum(low, -start / along - np.abs(edge / along))
        high = np.minimum(high, -start / along + np.abs(edge / along))
    # Integrals of 1 and of s / HALF_LINE over s from low to high
    length = np.maximum(high - low, 0.0)
    return np.stack([length, length * (high + low) / (2.0 * HALF_LINE)], axis=-1).astype(np.float32)


def _beside(lines: Vector, face: Vector, whole: float) -> NDArray[np.float32]:
    """Return the readings under a face, in units of `whole`, as the weighted sum over its lines.

    Args:
        lines: Readings under lines, shape (n, m + size of the face - 1, taxels).
        face: Weights of the face's lines.
        whole: Reading of a taxel under the face of an endless peg.
    """
    count = lines.shape[1] - face.size + 1
    summed = np.zeros((lines.shape[0], count, lines.shape[2]))
    for k in range(face.size):
        summed += face[k] * lines[:, k : k + count]
    made: NDArray[np.float32] = (summed / whole).astype(np.float32)
    return made
