"""The parts and places of a job: peg, hole and rack. Lengths are in m; bounds reject a length typed in mm."""

import math
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from drivers.config_model import ConfigModel, Quantity, Source
from drivers.part.contract import Part
from drivers.part.shapes import WORDS, Shape, part_of, section_of

Length = Annotated[float, Field(gt=0.0, le=0.5)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
Coordinate = Annotated[float, Field(ge=-2.0, le=2.0)]
Point = tuple[Coordinate, Coordinate, Coordinate]
PegSide = Annotated[float, Field(ge=0.002, le=0.03)]
Deviation = Annotated[float, Field(ge=5e-5, le=0.1)]
HoleSide = Annotated[float, Field(ge=0.002, le=0.031)]
Chamfer = Annotated[float, Field(ge=0.0, le=0.002)]


class Peg(ConfigModel):
    """The part to insert."""

    shape: Annotated[Shape, Source("set for each part")] = "round"
    """Shape of the peg's cross-section, and of the hole's; a square is a rectangle with equal sides."""
    diameter: Annotated[
        Annotated[float, Field(ge=0.002, le=0.03)] | None, Quantity("m"), Source("[gibbons], Sec. VI")
    ] = None
    """Diameter of a round peg, m; for other shapes see `sides`."""
    sides: Annotated[tuple[PegSide, PegSide] | None, Quantity("m"), Source("set for each part")] = None
    """Sides of a square or rectangular peg, between the pads of the hand and across them, m."""
    chamfer: Annotated[Chamfer, Quantity("m"), Source("set for each part")] = 0.0
    """Width and height of a chamfer of 45 degrees round the end of a round peg, m; at least 1 mm less than the radius. The simulation
    and the lowest point of a leaning peg use it.
    """
    length: Annotated[float, Field(ge=0.02, le=0.15), Quantity("m"), Source("[gibbons], Sec. VI")]
    """Length from the finger centre to the end point, m; L of [gibbons], Eq. (2)."""
    overhang: Annotated[float, Field(ge=0.005, le=0.05), Quantity("m"), Source("assumed")]
    """Length of the peg beyond the finger centre, inside the hand, m."""
    mass: Annotated[
        float,
        Field(gt=0.0, le=1.0),
        Quantity("kg"),
        Source("derived for a steel cylinder of 8 mm diameter and 65 mm length"),
    ]
    """Mass of the peg, kg."""

    @property
    def part(self) -> Part:
        """Cross-section of the peg."""
        return part_of(self.shape, self.diameter, self.sides, self.chamfer)

    @model_validator(mode="after")
    def _has_size(self) -> Self:
        # Least radius of a chamfered peg's end face, m; chosen, not measured.
        most = self.part.reach - 1e-3
        if self.chamfer > 0.0 and self.chamfer >= most:
            raise ValueError(
                f"peg.chamfer = {self.chamfer}: leaves too little of the end; less than {most:g}, the radius less 1 mm, allowed"
            )
        return self


class HolePrior(ConfigModel):
    """Normal distribution of the hole's place in its area, with the axes of the base frame."""

    SOURCE: ClassVar[str] = "set for each part, or learnt as decision 0025 says"

    mean: Annotated[tuple[Coordinate, Coordinate], Quantity("m")]
    """Most likely place of the hole's middle along x and y, m, base frame; within `hole.area` about `hole.centre`."""
    deviation: Annotated[tuple[Deviation, Deviation], Quantity("m")]
    """Standard deviations of the hole's middle along x and y, m; they include the variation between parts and the uncertainty of the mean."""


class Latch(ConfigModel):
    """Resistance of a part on the last distance to the bottom of its hole: a detent that snaps in, or a light press fit."""

    SOURCE: ClassVar[str] = "set for each part"

    kind: Literal["detent", "press"]
    """Kind of the latch: a detent returns its energy behind the crest, a press fit dissipates it."""
    force: Annotated[
        float, Field(ge=1.0, le=40.0), Quantity("N"), Source("the part's drawing, or [bayer], mating force")
    ]
    """Largest resisting force along the hole, N: a detent at its crest, a press fit at the bottom."""
    height: Annotated[float, Field(ge=0.0015, le=0.01), Quantity("m")]
    """Height of the peg's end above the bottom at which the resistance begins, m; a detent's crest is deeper by a quarter
    of this height, and the detent pulls the part in over the last half.
    """


Bounds = tuple[tuple[float, float], tuple[float, float]]
"""Lower x and y, and upper x and y, of a rectangle, m, base frame."""
PLATE_BORDER = 0.04
"""Width of the solid plate around the area that contains the hole, m; assumed."""


class Hole(ConfigModel):
    """The hole for the peg, and the area that contains it."""

    diameter: Annotated[
        Annotated[float, Field(ge=0.002, le=0.031)] | None, Quantity("m"), Source("[gibbons], Sec. VI")
    ] = None
    """Diameter of a round hole, m; for other shapes see `sides`."""
    sides: Annotated[tuple[HoleSide, HoleSide] | None, Quantity("m"), Source("set for each part")] = None
    """Sides of the hole of a square or rectangular peg, in the order of `peg.sides`, m."""
    chamfer: Annotated[Chamfer, Quantity("m"), Source("set for each part")] = 0.0
    """Width and depth of a chamfer of 45 degrees round the mouth of a round hole (countersink), m, less than `depth`. The simulation
    uses the chamfer, and the search starts outside it.
    """
    centre: Annotated[Point, Quantity("m"), Source("set for each cell")]
    """Middle of the area that contains the hole, on the plate's surface, m, base frame."""
    area: Annotated[
        tuple[Annotated[float, Field(ge=0.0, le=0.2)], Annotated[float, Field(ge=0.0, le=0.2)]],
        Quantity("m"),
        Source("[gibbons], Sec. VI; set for each cell"),
    ]
    """Extent along x and y of the area that contains the hole, m; the hole is anywhere in it."""
    depth: Annotated[float, Field(ge=0.002, le=0.1), Quantity("m"), Source("set for each part")]
    """Depth of the tip below the surface at which the peg is seated and the switch closes, m."""
    yaw: Annotated[float, Field(ge=0.0, le=math.pi / 4), Quantity("rad"), Source("assumed; docs/tried/corners.md")] = (
        math.radians(10.0)
    )
    """Largest angle between the hole's sides and the base frame's x and y, rad; it has no effect on a round hole."""
    evidence: Annotated[Literal["switch", "force"], Source("set for each part")] = "switch"
    """Evidence of a seated part: the switch under the hole, or force against depth, which requires `hole.latch`."""
    latch: Latch | None = None
    """Resistance of the part on the last distance to the bottom; without this section the part has no latch."""
    prior: HolePrior | None = None
    """Probability of the hole's place in the area; the search starts at the most likely places. Without it all places are equally likely."""

    @property
    def part(self) -> Part:
        """Cross-section of the hole."""
        return section_of(self.diameter, self.sides, self.chamfer)

    @property
    def plate_bounds(self) -> Bounds:
        """Rectangle of the plate round the area that contains the hole."""
        half = [extent / 2 + PLATE_BORDER for extent in self.area]
        x, y = self.centre[:2]
        return (x - half[0], y - half[1]), (x + half[0], y + half[1])

    @model_validator(mode="after")
    def _has_size(self) -> Self:
        section_of(self.diameter, self.sides, self.chamfer)
        if self.chamfer >= self.depth:
            raise ValueError(
                f"hole.chamfer = {self.chamfer}: no bore is left; less than hole.depth = {self.depth} allowed"
            )
        if self.evidence == "force" and (self.latch is None or self.latch.kind != "detent"):
            found = (
                "no latch"
                if self.latch is None
                else f'a latch of kind "{self.latch.kind}" does not show the bottom by its force'
            )
            raise ValueError(f'hole.evidence = "force": {found}; a [hole.latch] of kind "detent", or "switch", allowed')
        if self.latch is not None and self.latch.height >= self.depth:
            raise ValueError(
                f"hole.latch.height = {self.latch.height}: begins above the hole; less than hole.depth = {self.depth} allowed"
            )
        return self

    @model_validator(mode="after")
    def _has_prior_inside(self) -> Self:
        if self.prior is not None:
            for axis, mean, centre, extent in zip("xy", self.prior.mean, self.centre, self.area, strict=False):
                if abs(mean - centre) > extent / 2 + 1e-9:
                    raise ValueError(
                        f"hole.prior.mean = {list(self.prior.mean)}: outside the area along {axis};"
                        f" {centre - extent / 2:g} to {centre + extent / 2:g} allowed"
                    )
        return self


class Rack(ConfigModel):
    """The rack of upright pegs."""

    SOURCE: ClassVar[str] = "set for each cell"

    first: Annotated[Point, Quantity("m")]
    """Place of the first slot on the rack's surface, m, base frame."""
    pitch: Annotated[Length, Quantity("m")]
    """Distance between slots along y, m."""
    slots: Annotated[int, Field(ge=1, le=100)]
    """Number of slots."""
    depth: Annotated[float, Field(ge=0.002, le=0.1), Quantity("m")]
    """Depth of a slot, m."""
    refill: Literal["feeder", "asked"] = "feeder"
    """Method of refilling slots: by a feeder before each slot's next turn, or by a person, whom the command REFILLED reports."""

    @property
    def bounds(self) -> Bounds:
        """Rectangle of the rack: half a pitch around the middles of its slots."""
        (x, y), half = self.first[:2], self.pitch / 2
        return (x - half, y - half), (x + half, y + self.pitch * (self.slots - 1) + half)


class HandShape(ConfigModel):
    """Space that a parallel hand occupies: capsules along the closing axis around its body and around its fingers."""

    stroke: Annotated[float, Field(gt=0.0, le=0.5)]
    """Largest distance between the pads, m."""
    body_offset: Annotated[float, Field(ge=-0.5, le=0.5)]
    """Place of the middle line of the body's capsule, along x of the finger frame, m."""
    body_radius: Annotated[float, Field(gt=0.0, le=0.2)]
    """Radius of the body's capsule, m."""
    finger_offset: Annotated[float, Field(ge=-0.5, le=0.5)]
    """Place of the middle line of the fingers' capsule, along x of the finger frame, m."""
    finger_radius: Annotated[float, Field(gt=0.0, le=0.2)]
    """Radius of the fingers' capsule, m."""
    half_span: Annotated[float, Field(gt=0.0, le=0.5)]
    """Half the length of both middle lines while the fingers are wide open, m."""


class Job(ConfigModel):
    """One part, its places, and the hand that moves it."""

    peg: Peg
    hole: Hole
    rack: Rack
    hand: HandShape
    slot: Annotated[int, Field(ge=0)] = 0
    """Number of the slot from which the hand takes the peg."""


def require_fit(peg: Peg, hole: Hole) -> None:
    """Check that a peg is smaller than its hole in every direction, and that both have one shape.

    Raises:
        ValueError: The peg is larger than the hole in one direction, or their shapes differ; one line.
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
