"""The parts and places of a job: peg, hole, rack. Lengths in m; bounds reject a length typed in mm."""

import math
from typing import Annotated, Literal

from pydantic import Field

from drivers.config_model import ConfigModel

Length = Annotated[float, Field(gt=0.0, le=0.5)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
Coordinate = Annotated[float, Field(ge=-2.0, le=2.0)]
Point = tuple[Coordinate, Coordinate, Coordinate]


class Peg(ConfigModel):
    """The part to insert."""

    diameter: Annotated[float, Field(ge=0.002, le=0.03)]
    """Of a round peg, or the side of a square one, m."""
    length: Annotated[float, Field(ge=0.02, le=0.15)]
    """L of [gibbons], Eq. (2): from the finger centre to the end point, m."""
    overhang: Annotated[float, Field(ge=0.005, le=0.05)]
    """How far the peg reaches beyond the finger centre, into the hand, m."""
    shape: Literal["round", "square"] = "round"
    mass: Annotated[float, Field(gt=0.0, le=1.0)]
    """kg."""


class Hole(ConfigModel):
    """Where the peg shall go."""

    diameter: Annotated[float, Field(ge=0.002, le=0.031)]
    """Of a round hole, or the side of a square one, m."""
    centre: Point
    """Middle of the area that contains the hole, on the plate's surface, m, base frame."""
    area: tuple[Annotated[float, Field(ge=0.0, le=0.2)], Annotated[float, Field(ge=0.0, le=0.2)]]
    """Extent of that area along x and y, m; the hole is anywhere in it."""
    depth: Annotated[float, Field(ge=0.002, le=0.1)]
    """Depth of the tip below the surface at which the peg is seated and the switch closes, m."""
    tilt: Annotated[float, Field(ge=0.0, le=0.2)] = 0.0
    """Angle between the real plate's normal and the vertical, rad; the skills do not know it."""
    yaw: Annotated[float, Field(ge=0.0, le=math.pi / 4)] = math.radians(10.0)
    """A square hole's sides are turned from the base frame's x and y by at most this, rad; a round one has none."""
    present: bool = True
    """Whether the real plate has the hole: without, every find is a false one; the skills do not know it."""


class Rack(ConfigModel):
    """Where pegs stand upright, waiting."""

    first: Point
    """Surface of the rack at the first slot, m, base frame."""
    pitch: Length
    """Distance between slots along y, m."""
    slots: Annotated[int, Field(ge=1, le=100)]
    depth: Annotated[float, Field(ge=0.002, le=0.1)]
    """Depth of a slot, m."""


class Job(ConfigModel):
    """One part and its place: what a recipe names and a program works on."""

    peg: Peg
    hole: Hole
    rack: Rack
    slot: Annotated[int, Field(ge=0)] = 0
    """Slot to take the peg from."""
