"""Decoys drawn from the trial's seed, and the plate cut into tiles of one hole each.

A decoy is a feature of the plate that a search can mistake for the hole. A tile is a separate plate with its own
outline, so that the closed form of one bore applies to each tile, and only plates with decoys cost time. All tiles share
one surface: a contact point belongs to the tile on which it lies.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from drivers.errors import ConfigError
from drivers.parts import Hole
from drivers.quantities import Vector
from sim.config import DecoyConfig
from sim.contact.plate import Plate

DECOY_STREAM = 8
"""Key of the random stream for decoys; lower keys are in use."""
ROOM = 2e-3
"""Width of solid plate around every hole within its tile, m; more than the contact distance `contact.NEAR`."""

Rectangle = tuple[Vector, Vector]
"""Lower and upper corner, each of shape (2,), m, plate frame."""


class Pocket(NamedTuple):
    """A hole of the plate with straight walls down to its floor."""

    place: Vector
    """Centre of the pocket's mouth, shape (2,), m, plate frame."""
    half: tuple[float, float]
    """Half the pocket's extents along x and y, m."""
    depth: float
    """Depth of the pocket's floor, m."""

    @property
    def bounds(self) -> Rectangle:
        """Rectangle that must belong to the pocket's own tile."""
        reach = np.array(self.half) + ROOM
        return self.place - reach, self.place + reach


def with_decoys(plate: Plate, hole: Hole, config: DecoyConfig, seed: int) -> Plate:
    """Return a plate with the decoys drawn from this seed.

    Args:
        plate: The plate with its hole and no decoys.
        hole: The stated hole: decoys lie in its area, with sizes relative to it.
        config: Number and kinds of the decoys.
        seed: Seed of the trial.

    Raises:
        ConfigError: The area is too small for the decoys.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(DECOY_STREAM,)))
    mouth = max(plate.half[0] + plate.chamfer, 0.0), max(plate.half[1] + plate.chamfer, 0.0)
    own = Pocket(np.zeros(2), mouth, plate.depth)
    number = int(rng.integers(config.number[0], config.number[1] + 1))
    middle, half = np.array(plate.outline[:2]), np.array(plate.outline[2:])
    # Largest number of attempts to place the decoys so that each has a tile.
    for _ in range(1000):
        pockets = [own, *(_drawn(plate, hole, config, rng) for _ in range(number))]
        bounds = cut([pocket.bounds for pocket in pockets], (middle - half, middle + half))
        if bounds:
            tiles = [_tile(plate, *each) for each in zip(pockets[1:], bounds[1:], strict=True)]
            return replace(plate, tiles=(replace(plate, outline=_outline(*bounds[0])), *tiles))
    raise ConfigError(
        f"sim.plate.decoys.number = {list(config.number)}: no room beside the hole in hole.area = {list(hole.area)}; fewer allowed"
    )


def _drawn(plate: Plate, hole: Hole, config: DecoyConfig, rng: np.random.Generator) -> Pocket:
    kinds = config.blind, config.through, config.dent
    kind = kinds[rng.integers(len(kinds))]
    away = np.array(hole.centre[:2]) + rng.uniform(-0.5, 0.5, 2) * hole.area - plate.position[:2]
    size, half = rng.uniform(*kind.size), hole.part.half
    place = (plate.rotation.T @ np.array([*away, 0.0]))[:2]
    return Pocket(place, (size * half[0], size * half[1]), float(rng.uniform(*kind.depth)))


def cut(needed: Sequence[Rectangle], whole: Rectangle) -> list[Rectangle] | None:
    """Divide a rectangle into one tile around each needed rectangle; None if straight cuts cannot separate them.

    Each cut crosses a whole rectangle, half-way between the needed rectangles on either side.
    """
    if len(needed) == 1:
        (low, high), (lowest, highest) = needed[0], whole
        return [whole] if np.all(low >= lowest) and np.all(high <= highest) else None
    for axis in range(2):
        order = sorted(range(len(needed)), key=lambda i: float(needed[i][0][axis]))
        for first in range(1, len(order)):
            tiles = _cut_across([needed[i] for i in order], first, axis, whole)
            if tiles:
                found = dict(zip(order, tiles, strict=True))
                return [found[i] for i in range(len(needed))]
    return None


def _cut_across(needed: Sequence[Rectangle], first: int, axis: int, whole: Rectangle) -> list[Rectangle] | None:
    """Divide a rectangle by a cut across `axis`, before number `first` of the needed rectangles; None if the cut would cross one.

    The needed rectangles are sorted along `axis`.
    """
    ends, begins = max(float(high[axis]) for _, high in needed[:first]), float(needed[first][0][axis])
    if begins < ends:
        return None
    below, above = (np.array(corner) for corner in (whole[1], whole[0]))
    below[axis] = above[axis] = (ends + begins) / 2
    one, other = cut(needed[:first], (whole[0], below)), cut(needed[first:], (above, whole[1]))
    return [*one, *other] if one and other else None


def _outline(low: Vector, high: Vector) -> tuple[float, float, float, float]:
    (x, y), (half_x, half_y) = (low + high) / 2, (high - low) / 2
    return float(x), float(y), float(half_x), float(half_y)


def _tile(plate: Plate, pocket: Pocket, bounds: Rectangle) -> Plate:
    """Return the tile of a decoy; its frame has its origin at the decoy's mouth."""
    return Plate(
        plate.position + plate.rotation @ np.array([*pocket.place, 0.0]),
        plate.rotation,
        pocket.half,
        pocket.depth,
        _outline(bounds[0] - pocket.place, bounds[1] - pocket.place),
        rubbing=plate.rubbing,
    )
