"""Geometry of each kind of part in MuJoCo, and its contacts with a plate; the only module that selects them by part."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from drivers.part.contract import Part
from sim.contact import cylinder, rectangular


@dataclass(frozen=True, slots=True)
class Solid:
    """Simulation of one kind of part."""

    geom: str
    """MuJoCo's name of the peg's geom type."""
    size: Callable[[Part], str]
    """Sizes of the geom across its axis, in MuJoCo's order."""
    install: Callable[[], None]
    """Installs the contacts with a plate in this process's collision table; repeated calls are harmless."""


SOLIDS: Mapping[str, Solid] = {
    "round": Solid("cylinder", lambda part: f"{part.reach}", cylinder.install),
    "rectangular": Solid("box", lambda part: f"{part.half[0]} {part.half[1]}", rectangular.install),
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
