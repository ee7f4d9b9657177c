"""The parts and places of a job: peg, hole, rack. Lengths in m; bounds reject a length typed in mm."""

import math
from typing import Annotated, Self

from pydantic import Field, model_validator

from drivers.config_model import ConfigModel
from drivers.part.contract import Part
from drivers.part.shapes import WORDS, Shape, part_of, section_of

Length = Annotated[float, Field(gt=0.0, le=0.5)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
Coordinate = Annotated[float, Field(ge=-2.0, le=2.0)]
Point = tuple[Coordinate, Coordinate, Coordinate]
PegSide = Annotated[float, Field(ge=0.002, le=0.03)]
HoleSide = Annotated[float, Field(ge=0.002, le=0.031)]


class Peg(ConfigModel):
    """The part to insert."""

    shape: Shape = "round"
    """Shape of the peg's cross-section, and of the hole's; a square is a rectangle with equal sides."""
    diameter: Annotated[float, Field(ge=0.002, le=0.03)] | None = None
    """Diameter of a round peg, m; for other shapes see `sides`."""
    sides: tuple[PegSide, PegSide] | None = None
    """Sides of a square or rectangular peg, between the pads of the hand and across them, m."""
    length: Annotated[float, Field(ge=0.02, le=0.15)]
    """Length from the finger centre to the end point, m; L of [gibbons], Eq. (2)."""
    overhang: Annotated[float, Field(ge=0.005, le=0.05)]
    """Length that reaches beyond the finger centre into the hand, m."""
    mass: Annotated[float, Field(gt=0.0, le=1.0)]
    """Mass of the peg, kg."""

    @property
    def part(self) -> Part:
        """Cross-section of the peg."""
        return part_of(self.shape, self.diameter, self.sides)

    @model_validator(mode="after")
    def _has_size(self) -> Self:
        part_of(self.shape, self.diameter, self.sides)
        return self


class Hole(ConfigModel):
    """Where the peg shall go."""

    diameter: Annotated[float, Field(ge=0.002, le=0.031)] | None = None
    """Diameter of a round hole, m; for other shapes see `sides`."""
    sides: tuple[HoleSide, HoleSide] | None = None
    """Sides of the hole of a square or rectangular peg, in the order of `peg.sides`, m."""
    centre: Point
    """Middle of the area that contains the hole, on the plate's surface, m, base frame."""
    area: tuple[Annotated[float, Field(ge=0.0, le=0.2)], Annotated[float, Field(ge=0.0, le=0.2)]]
    """Extent along x and y of the area that contains the hole, m; the hole is anywhere in it."""
    depth: Annotated[float, Field(ge=0.002, le=0.1)]
    """Depth of the tip below the surface at which the peg is seated and the switch closes, m."""
    tilt: Annotated[float, Field(ge=0.0, le=0.2)] = 0.0
    """Angle between the real plate's normal and the vertical, rad; the skills do not know it."""
    yaw: Annotated[float, Field(ge=0.0, le=math.pi / 4)] = math.radians(10.0)
    """Largest angle by which the hole's sides are turned from the base frame's x and y, rad; a round hole has none."""
    present: bool = True
    """Whether the real plate has the hole; without it every find is a false one, and the skills do not know it."""

    @property
    def part(self) -> Part:
        """Cross-section of the hole."""
        return section_of(self.diameter, self.sides)

    @model_validator(mode="after")
    def _has_size(self) -> Self:
        section_of(self.diameter, self.sides)
        return self


class Rack(ConfigModel):
    """Where pegs stand upright, waiting."""

    first: Point
    """Place of the first slot on the rack's surface, m, base frame."""
    pitch: Length
    """Distance between slots along y, m."""
    slots: Annotated[int, Field(ge=1, le=100)]
    """Number of slots."""
    depth: Annotated[float, Field(ge=0.002, le=0.1)]
    """Depth of a slot, m."""


class Job(ConfigModel):
    """One part and its place: what a recipe names and a program works on."""

    peg: Peg
    hole: Hole
    rack: Rack
    slot: Annotated[int, Field(ge=0)] = 0
    """Slot to take the peg from."""


def require_fit(peg: Peg, hole: Hole) -> None:
    """Make sure that a peg is smaller than its hole in every direction, and that both have one shape.

    Raises:
        ValueError: It is not; one line.
    """
    if (peg.diameter is None) != (hole.diameter is None):
        raise ValueError(f'hole.{WORDS[peg.shape]}: missing; needed because peg.shape = "{peg.shape}"')
    if peg.part.clearance(hole.part) > 0.0:
        return
    if peg.diameter is not None:
        raise ValueError(
            f"peg.diameter = {peg.diameter}: thicker than the hole; less than hole.diameter = {hole.diameter} allowed"
        )
    assert peg.sides is not None
    assert hole.sides is not None
    own, around = next(pair for pair in zip(peg.sides, hole.sides, strict=True) if pair[0] >= pair[1])
    raise ValueError(
        f"peg.sides = {list(peg.sides)}: {own} is wider than the hole; less than {around} of"
        f" hole.sides = {list(hole.sides)} allowed"
    )


def halfway(peg: Peg, hole: Hole) -> Hole:
    """Return a hole of the same shape whose size is in the middle between the peg's and this one's."""
    if peg.diameter is not None and hole.diameter is not None:
        return hole.model_copy(update={"diameter": (peg.diameter + hole.diameter) / 2})
    assert peg.sides is not None
    assert hole.sides is not None
    sides = tuple((inner + outer) / 2 for inner, outer in zip(peg.sides, hole.sides, strict=True))
    return hole.model_copy(update={"sides": sides})
