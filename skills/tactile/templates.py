"""Readings of the taxels for a peg at any angle and offset, in closed form: the model that estimators compare a frame
with.

The peg presses a line into each pad. Its load per metre is a constant and a part that rises along the peg; its groove
has the parabolic pressure of a bed of springs; the elastomer blurs with a Gaussian, and a taxel averages over its disc.
Along the line the blurred load is a difference of error functions; disc and groove are small sums. A peg with flat
sides presses a face, which is an even mean of parallel lines.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.config_model import ConfigModel
from drivers.parts import Peg
from drivers.quantities import FINGERS, TAXELS, Vector
from drivers.skin.layout import Layout, finger_positions, pad_size


class TemplateParams(ConfigModel):
    """The pad as its maker states it; the simulated pad may differ.

    Source: chosen on simulated pads, its effect measured by `cell study tactile`.
    """

    blur: Annotated[float, Field(ge=1e-4, le=1e-2)] = 1.2e-3
    """Standard deviation of the point spread of 1 mm of elastomer, m; assumed, about the thickness."""
    taxel_diameter: Annotated[float, Field(ge=1e-3, le=7e-3)] = 4e-3
    """Diameter of the round area that one taxel averages over, m; assumed, about half the pitch."""
    indentation: Annotated[float, Field(ge=1e-5, le=3e-3)] = 8.5e-4
    """Depth of the groove that a usual grip leaves, m; the groove then reaches 2.6 mm to either side under 8 mm."""
    theta_step: Annotated[float, Field(ge=2e-3, le=0.1)] = math.pi / 360
    """Angle between neighbouring templates, rad."""
    offset_step: Annotated[float, Field(ge=5e-5, le=2e-3)] = 2.5e-4
    """Offset between neighbouring templates, m."""
    offset_reach: Annotated[float, Field(ge=1e-3, le=1e-2)] = 4e-3
    """Largest distance of the peg's axis from the finger centre, m."""

    def broader(self, factor: float) -> Self:
        """Return the pad with prints that are broader by `factor`, point spread and groove alike."""
        return self.model_copy(update={"blur": factor * self.blur, "indentation": factor**2 * self.indentation})


@dataclass(frozen=True, slots=True, eq=False)
class Templates:
    """Readings of every taxel for all angles and offsets of one grid."""

    theta: Vector
    """Angles, shape (n,), rad, from -pi/2 up, evenly spaced over half a turn."""
    offset: Vector
    """Offsets, shape (m,), m, evenly spaced about 0."""
    even: NDArray[np.float32]
    """Readings for a load of 1 along the whole peg, shape (n, m, 40); a taxel under an endless peg reads 1."""
    rising: NDArray[np.float32]
    """Readings for a load that rises from 0 at the finger centre to 1 at `HALF_LINE` towards the tip, shape (n, m, 40)."""


@lru_cache(maxsize=64)
def make_templates(layout: Layout, peg: Peg, params: TemplateParams) -> Templates:
    """Return the templates of a peg on one layout; the first call takes a fraction of a second."""
    from skills.tactile.template_fill import fill  # imports the compiler, which only a comparison of frames needs

    half = math.pi / 2
    count = max(4, 4 * round(math.pi / params.theta_step / 4))
    theta = np.arange(count, dtype=np.float64) * (math.pi / count) - half
    side = round(params.offset_reach / params.offset_step)
    offset = np.arange(-side, side + 1, dtype=np.float64) * params.offset_step
    length, width = pad_size(layout)
    # Seven points integrate polynomials over a disc exactly up to the fifth power.
    turn = np.arange(6) * math.pi / 3
    reach = params.taxel_diameter / 2 * math.sqrt(2.0 / 3.0)
    disc = np.concatenate([[[0.0, 0.0]], reach * np.column_stack([np.cos(turn), np.sin(turn)])])
    disc_weights = np.array([0.25] + [0.125] * 6)
    groove, groove_weights = peg.part.face.groove(params.indentation)
    face = peg.part.face.strips(params.offset_step)
    lines = np.arange(-(side + face.size // 2), side + face.size // 2 + 1, dtype=np.float64) * params.offset_step
    taxels = np.ascontiguousarray(finger_positions(layout)[1])
    even = np.zeros((theta.size, lines.size, FINGERS * TAXELS))
    rising = np.zeros_like(even)
    arguments = (disc, disc_weights, groove, groove_weights, params.blur)
    pad = (length / 2, width / 2, peg.length, peg.overhang)
    right = slice(TAXELS, None)
    fill(theta, lines, taxels, *pad, *arguments, even[..., right], rising[..., right])
    # The left finger is the mirror image of the right one about the finger's axis.
    mirrored = [np.zeros_like(even[:1, :, right]) for _ in range(2)]
    fill(-theta[:1], lines, taxels, *pad, *arguments, *mirrored)
    for table, first in zip((even, rising), mirrored, strict=True):
        table[1:, :, :TAXELS] = table[:0:-1, ::-1, right]
        table[0, :, :TAXELS] = first[0, ::-1]
    under = np.zeros((1, face.size, 1))
    middle = lines[lines.size // 2 - face.size // 2 :][: face.size]
    fill(np.zeros(1), middle, np.zeros((1, 2)), 0.1, 0.1, 0.1, 0.1, *arguments, under, np.zeros_like(under))
    whole = float(face @ under[0, :, 0])
    made = Templates(theta, offset, _beside(even, face, whole), _beside(rising, face, whole))
    for array in (made.theta, made.offset, made.even, made.rising):
        array.flags.writeable = False
    return made


def _beside(lines: Vector, face: Vector, whole: float) -> NDArray[np.float32]:
    """Return the readings under a face from those under lines, shape (n, m + face's size - 1, 40), in units of `whole`."""
    count = lines.shape[1] - face.size + 1
    summed = np.zeros((lines.shape[0], count, lines.shape[2]))
    for k in range(face.size):
        summed += face[k] * lines[:, k : k + count]
    made: NDArray[np.float32] = (summed / whole).astype(np.float32)
    return made
