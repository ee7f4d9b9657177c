"""The geometry of each kind of part in MuJoCo, and its contacts with a plate; the one place that chooses them by the part."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from drivers.part.contract import Part
from sim import cylinder, rectangular


@dataclass(frozen=True, slots=True)
class Solid:
    """How one kind of part is simulated."""

    geom: str
    """MuJoCo's name of the peg's geom type."""
    size: Callable[[Part], str]
    """Sizes of the geom across its axis, in MuJoCo's order."""
    install: Callable[[], None]
    """Puts the contacts with a plate into this process's collision table; harmless when repeated."""


SOLIDS: Mapping[str, Solid] = {
    "round": Solid("cylinder", lambda part: f"{part.reach}", cylinder.install),
    "rectangular": Solid("box", lambda part: f"{part.half[0]} {part.half[1]}", rectangular.install),
}
"""By the part's kind."""


def install() -> None:
    """Put the contacts of all kinds of parts into this process's collision table; harmless when repeated."""
    for solid in SOLIDS.values():
        solid.install()


def peg_geom(part: Part, half_length: float) -> str:
    """Return type and size of a peg's geom, as attributes of MuJoCo's XML."""
    solid = SOLIDS[part.kind]
    return f'type="{solid.geom}" size="{solid.size(part)} {half_length}"'
