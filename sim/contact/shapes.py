"""Geometry of each kind of part in MuJoCo, and its contacts with a plate; the only module that selects them by part."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import mujoco

from drivers.part.contract import Part
from sim.contact import cylinder, rectangular
from sim.contact.table import PLATE_TYPE
from sim.world import native


@dataclass(frozen=True, slots=True)
class Solid:
    """Simulation of one kind of part."""

    name: str
    """MuJoCo's name of the peg's geom type."""
    geom: mujoco.mjtGeom
    """Geom type of the peg; no other body of the scene has this type and collides with a plate."""
    size: Callable[[Part], str]
    """Radius or half sides of the geom, m, as text in MuJoCo's order."""
    collide: Callable[..., Any]
    """Function that finds the contacts with a plate, see `sim.world.native.collide_by`."""


SOLIDS: Mapping[str, Solid] = {
    "round": Solid("cylinder", mujoco.mjtGeom.mjGEOM_CYLINDER, lambda part: f"{part.reach}", cylinder.collide),
    "rectangular": Solid(
        "box", mujoco.mjtGeom.mjGEOM_BOX, lambda part: f"{part.half[0]} {part.half[1]}", rectangular.collide
    ),
}
"""Simulation of each kind of part."""


def install(part: Part) -> None:
    """Install the contacts of a kind of part in this process's collision table; repeated calls are harmless."""
    solid = SOLIDS[part.kind]
    native.collide_by(PLATE_TYPE, solid.geom, solid.collide)


def peg_geom(part: Part, half_length: float) -> str:
    """Return type, size, m, and chamfer, m, of a peg's geom as attributes of MuJoCo's XML.

    The chamfer is the first word of `geom_user`.
    """
    solid = SOLIDS[part.kind]
    return f'type="{solid.name}" size="{solid.size(part)} {half_length}" user="{part.chamfer!r}"'
