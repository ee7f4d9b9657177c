"""A plate with its hole, and its models: closed form, or facets for MuJoCo's own collision detection.

A ring of boxes tangent to the hole leaves a gap at every corner, R (1/cos(pi/N) - 1); flats that rotate with the peg
leave none. Facets use MuJoCo's contact of box and cylinder. The closed form can run in parallel as a probe, which makes
no contacts and only meters the penetration.
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from drivers.quantities import Vector
from sim import contact, flats
from sim.config import ModelConfig

SIMP = "0.9999 0.9999 0.00001"
"""Parameter `solimp` of facets: MuJoCo's stiffest, within 10 um."""
RING_WIDTH = 0.05
"""Half the width of a box of the ring, radially, m."""
FLOOR = 0.01
"""Half the thickness of the floor of a faceted hole, m."""
EXACT = ModelConfig()


@dataclass(frozen=True, slots=True, eq=False)
class Plate:
    """True geometry of a plate with its hole."""

    position: Vector
    """Centre of the hole's mouth, shape (3,), m, base frame."""
    rotation: Vector
    """Axes of the plate, shape (3, 3), z outward; x and y along the sides of a hole with sides."""
    half: tuple[float, float]
    """Half the extents of the hole along x and y, m: the radius twice, or half of each side."""
    depth: float
    """Depth of the floor, m."""

    outline: tuple[float, float, float, float] = contact.ENDLESS
    """Centre and half the extents of the plate along x and y of its own frame, m; no contacts outside."""
    chamfer: float = 0.0
    """Width and depth of the chamfer of 45 degrees at the mouth of a round hole, m."""
    rubbing: contact.Rubbing = contact.EVEN
    """Change of the friction with speed and position."""
    tiles: tuple["Plate", ...] = ()
    """Tiles of one hole each, the plate's own hole first, see `sim.decoys`; empty for a plate with one hole."""

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


def geoms(
    name: str, plate: Plate, friction: float, timestep: float, model: ModelConfig = EXACT, is_judged: bool = True
) -> list[str]:
    """Return the plate as geoms in MuJoCo's XML, the closed form first.

    Args:
        name: Name of the first geom.
        plate: Pose of the plate, and its hole.
        friction: Coulomb coefficient against the peg.
        timestep: Time step of the physics, s.
        model: Model of the hole.
        is_judged: True to meter the penetration even if facets make the contacts.
    """
    if plate.tiles:
        tiles = ((name if i == 0 else f"{name} {i}", tile) for i, tile in enumerate(plate.tiles))
        return [geom for each, tile in tiles for geom in geoms(each, tile, friction, timestep, model, is_judged)]
    solref = stiffness(model, timestep)
    has_facets = model.hole in ("flats", "boxes")
    has_flats = model.hole == "flats"
    mode = contact.UNPREDICTED if model.hole == "unpredicted" else contact.EXACT
    if has_facets:
        mode = contact.PROBE if is_judged else contact.NONE
    how = (timestep, solref, mode, has_flats)
    user = contact.plate_user(plate.half, plate.depth, friction, *how, plate.outline, plate.chamfer, plate.rubbing)
    x, y, half_x, half_y = plate.outline
    # The ellipsoid bounds the volume in which MuJoCo calls the closed form.
    around = math.hypot(abs(x) + half_x, abs(y) + half_y)
    shapes = [
        f'<geom name="{name}" type="ellipsoid" size="{words((around, around, around))}" {_pose(plate, np.zeros(3), 0.0)} '
        f'contype="1" conaffinity="0" user="{words(user)}"/>'
    ]
    if not has_facets:
        return shapes
    boxes = [(flats.FLAT_SIZE, flats.SECTOR * k) for k in range(flats.FLATS)]
    if not has_flats:
        side = (plate.half[0] + 2.0 * RING_WIDTH) * math.tan(math.pi / model.facets)
        angles = 2.0 * math.pi / model.facets * np.arange(model.facets)
        boxes = [((RING_WIDTH, side, plate.depth / 2), float(angle)) for angle in angles]
    for size, angle in boxes:
        reach = plate.half[0] + size[0]
        at = np.array([reach * math.cos(angle), reach * math.sin(angle), -size[2]])
        shapes.append(_box(size, _pose(plate, at, angle), solref, friction))
    shapes.append(
        _box((0.02, 0.02, FLOOR), _pose(plate, np.array([0.0, 0.0, -plate.depth - FLOOR]), 0.0), solref, friction)
    )
    return shapes


def stiffness(model: ModelConfig, timestep: float) -> tuple[float, float]:
    """Return the contacts' `solref`: a time constant, s, and a damping ratio, or -k and -b if k is given."""
    if model.stiffness is not None:
        return -model.stiffness, -2.0 * math.sqrt(model.stiffness)
    return max(model.time_constant * timestep, model.contact_time), 1.0


def flags(model: ModelConfig) -> str:
    """Return MuJoCo's flags for this model of the hole."""
    if model.hole in ("exact", "unpredicted"):
        return ""
    # Without the mid-phase, MuJoCo processes the first geom before the flats that it rotates.
    path = "enable" if model.native_ccd else "disable"
    return f'nativeccd="{path}" multiccd="disable" midphase="disable"'


def words(values: object) -> str:
    """Return numbers in XML form, to the last digit."""
    return " ".join(repr(float(v)) for v in np.asarray(values).ravel())


def _pose(plate: Plate, at: Vector, angle: float) -> str:
    turned = plate.rotation @ np.array(
        [[math.cos(angle), -math.sin(angle), 0.0], [math.sin(angle), math.cos(angle), 0.0], [0.0, 0.0, 1.0]]
    )
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, turned.flatten())
    return f'pos="{words(plate.position + plate.rotation @ at)}" quat="{words(quat)}"'


def _box(size: tuple[float, float, float], pose: str, solref: tuple[float, float], friction: float) -> str:
    friction = max(friction, contact.FRICTION_FLOOR)
    return (
        f'<geom type="box" size="{words(size)}" {pose} friction="{friction} 0.001 0.00001" priority="1" '
        f'solref="{words(solref)}" solimp="{SIMP}" contype="1" conaffinity="0"/>'
    )
