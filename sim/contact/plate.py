"""A plate with its hole in closed form, as MuJoCo's geoms."""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from drivers.quantities import Vector
from sim.contact import table as contact

CONTACT_STEPS = 2.0
"""Time constant of the contacts, multiple of the time step: the stiffest of MuJoCo's standard form."""
CONTACT_TIME = 1e-3
"""Lower bound of the contacts' time constant, s; equal to that of the default step, so that contact forces stay the
same if the step is shorter (decision 0002)."""


@dataclass(frozen=True, slots=True, eq=False)
class Plate:
    """True geometry of a plate with its hole."""

    position: Vector
    """Centre of the hole's mouth, shape (3,), m, base frame."""
    rotation: Vector
    """Axes of the plate, shape (3, 3), z outward; x and y along the sides of a hole with sides."""
    half: tuple[float, float]
    """Half the extents of the hole along x and y, m: (radius, radius) of a round hole, or half of each side."""
    depth: float
    """Depth of the floor, m."""

    outline: tuple[float, float, float, float] = contact.ENDLESS
    """Centre and half the extents of the plate along x and y of its own frame, m; no contacts outside."""
    chamfer: float = 0.0
    """Width and depth of the chamfer of 45 degrees at the mouth of a round hole, m."""
    rubbing: contact.Rubbing = contact.EVEN
    """Change of the friction with speed and position."""
    tiles: tuple["Plate", ...] = ()
    """Tiles with one hole each, see `sim.contact.decoys`; the first has the plate's own hole. Empty for a plate with one hole."""

    def is_below(self, place: Vector) -> bool:
        """True if the plate lies below a position, shape (3,), m, base frame."""
        x, y, height = self.rotation.T @ (place - self.position)
        middle_x, middle_y, half_x, half_y = self.outline
        return bool(height > 0.0 and abs(x - middle_x) <= half_x and abs(y - middle_y) <= half_y)


def outline_of(
    place: Vector, rotation: Vector, low: tuple[float, float], high: tuple[float, float]
) -> tuple[float, float, float, float]:
    """Return the outline of a plate that covers a rectangle of the base frame, see `Plate`.

    Args:
        place: Centre of the hole's mouth, shape (3,), m, base frame.
        rotation: Axes of the plate, shape (3, 3).
        low: Smallest x and y of the rectangle, m, base frame.
        high: Largest x and y, m.
    """
    away = np.array([(low[0] + high[0]) / 2 - place[0], (low[1] + high[1]) / 2 - place[1], 0.0])
    x, y, _ = rotation.T @ away
    half_x, half_y, _ = np.abs(rotation.T) @ np.array([(high[0] - low[0]) / 2, (high[1] - low[1]) / 2, 0.0])
    return float(x), float(y), float(half_x), float(half_y)


def geoms(name: str, plate: Plate, friction: float, timestep: float) -> list[str]:
    """Return the plate as geoms in MuJoCo's XML, one for each tile.

    Args:
        name: Name of the first geom.
        plate: Pose of the plate, and its hole.
        friction: Coulomb coefficient against the peg.
        timestep: Time step of the physics, s.
    """
    solref = max(CONTACT_STEPS * timestep, CONTACT_TIME), 1.0
    return [
        closed_form(name if i == 0 else f"{name} {i}", tile, friction, timestep, solref)
        for i, tile in enumerate(plate.tiles or (plate,))
    ]


def closed_form(
    name: str,
    plate: Plate,
    friction: float,
    timestep: float,
    solref: tuple[float, float],
    mode: int = contact.EXACT,
) -> str:
    """Return the geom of a plate with one hole; `solref` and `mode` as in `contact.plate_user`."""
    how = (timestep, solref, mode)
    user = contact.plate_user(plate.half, plate.depth, friction, *how, plate.outline, plate.chamfer, plate.rubbing)
    x, y, half_x, half_y = plate.outline
    # The ellipsoid bounds the volume in which MuJoCo calls the closed form.
    around = math.hypot(abs(x) + half_x, abs(y) + half_y)
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, plate.rotation.flatten())
    return (
        f'<geom name="{name}" type="ellipsoid" size="{words((around, around, around))}" '
        f'pos="{words(plate.position)}" quat="{words(quat)}" contype="1" conaffinity="0" user="{words(user)}"/>'
    )


def words(values: object) -> str:
    """Return numbers in XML form, to the last digit."""
    return " ".join(repr(float(v)) for v in np.asarray(values).ravel())
