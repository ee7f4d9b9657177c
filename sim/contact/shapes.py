"""Geometry of each kind of part in MuJoCo, and its contacts with a plate; the only module that selects them by part."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from drivers.part.contract import Part
from drivers.quantities import Vector
from sim.contact import cylinder, rectangular
from sim.contact.section import chamfered_depth, polygonal_depth, section_depth

POINTS = 4001
"""Number of points on a round rim for the exact depth."""


@dataclass(frozen=True, slots=True)
class Solid:
    """Simulation of one kind of part."""

    geom: str
    """MuJoCo's name of the peg's geom type."""
    size: Callable[[Part], str]
    """Sizes of the geom across its axis, in MuJoCo's order."""
    install: Callable[[], None]
    """Installs the contacts with a plate in this process's collision table; repeated calls are harmless."""
    depth: Callable[[Part, Part, Vector], float]
    """Returns the exact depth, m, of a peg with these axes, shape (3, 3), in a hole along x and y, from sections."""


def _round_depth(peg: Part, hole: Part, axes: Vector) -> float:
    tilt = math.atan2(math.hypot(axes[0, 2], axes[1, 2]), axes[2, 2])
    if peg.chamfer > 0.0 or hole.chamfer > 0.0:
        return chamfered_depth(peg, hole, tilt, POINTS // 2 + 1)
    return section_depth(peg.thickness, hole.thickness, tilt, POINTS)


SOLIDS: Mapping[str, Solid] = {
    "round": Solid("cylinder", lambda part: f"{part.reach}", cylinder.install, _round_depth),
    "rectangular": Solid("box", lambda part: f"{part.half[0]} {part.half[1]}", rectangular.install, polygonal_depth),
}
"""Simulation of each kind of part."""


def install(part: Part) -> None:
    """Install the contacts of a kind of part in this process's collision table; repeated calls are harmless."""
    SOLIDS[part.kind].install()


def peg_geom(part: Part, half_length: float) -> str:
    """Return type, size and chamfer of a peg's geom as attributes of MuJoCo's XML.

    The chamfer is the first word of `geom_user`.
    """
    solid = SOLIDS[part.kind]
    return f'type="{solid.geom}" size="{solid.size(part)} {half_length}" user="{part.chamfer!r}"'


def exact_depth(peg: Part, hole: Part, axes: Vector) -> float:
    """Return the exact depth of the lowest point of a peg with these axes, shape (3, 3), in a hole along x and y, m."""
    return SOLIDS[peg.kind].depth(peg, hole, axes)
