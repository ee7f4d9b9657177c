"""Models of the hole besides the shipped one, for the ladder of `cell study contact`; no cell uses them.

A ring of N boxes tangent to a hole of radius R leaves a gap R (1/cos(pi/N) - 1) at every corner. Boxes use MuJoCo's contact
of box and cylinder. The closed form can run in parallel as a probe, which makes no contacts and only meters the penetration.
"""

import math
from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np

from drivers.part.contract import Part
from drivers.quantities import Vector
from sim.contact import table as contact
from sim.contact.plate import CONTACT_STEPS, CONTACT_TIME, Plate, closed_form, words

SIMP = "0.9999 0.9999 0.00001"
"""Parameter `solimp` of facets: MuJoCo's stiffest, within 10 um."""
FLOOR = 0.01
"""Half the thickness of the floor of a faceted hole, m."""


@dataclass(frozen=True, slots=True)
class HoleModel:
    """One model of the hole."""

    hole: Literal["exact", "unpredicted", "boxes"] = "exact"
    """Kind of the model; `exact` is in closed form, `unpredicted` omits contacts with a gap, `boxes` form a ring."""
    facets: int = 64
    """Number of facets of the ring of boxes."""
    native_ccd: bool = False
    """True to use MuJoCo's newer collision code for facets, which makes ghost contacts at seams."""
    time_constant: float = CONTACT_STEPS
    """Time constant of the contacts, multiple of the time step."""
    contact_time: float = CONTACT_TIME
    """Lower bound of the contacts' time constant, s."""
    stiffness: float | None = None
    """Stiffness of the contacts with critical damping: force over penetration and effective mass, 1/s². It replaces the
    time constant; None keeps it."""

    @property
    def has_facets(self) -> bool:
        """True if facets make the contacts."""
        return self.hole == "boxes"

    def has_hole_for(self, part: Part) -> bool:
        """Return True if this model supports such parts; facets need a round hole without a chamfer."""
        return not self.has_facets or (part.symmetry == 0.0 and part.chamfer == 0.0)

    def solref(self, timestep: float) -> tuple[float, float]:
        """Return the contacts' `solref`: a time constant, s, and a damping ratio, or -k and -b if k is given."""
        if self.stiffness is not None:
            return -self.stiffness, -2.0 * math.sqrt(self.stiffness)
        return max(self.time_constant * timestep, self.contact_time), 1.0

    def flags(self) -> str:
        """Return MuJoCo's flags for this model."""
        if not self.has_facets:
            return ""
        path = "enable" if self.native_ccd else "disable"
        return f'nativeccd="{path}" multiccd="disable" midphase="disable"'


def geoms(plate: Plate, friction: float, timestep: float, model: HoleModel, is_judged: bool) -> list[str]:
    """Return the plate with this model of its hole as geoms in MuJoCo's XML, the closed form first.

    Args:
        plate: Pose of the plate, and its hole.
        friction: Coulomb coefficient against the peg.
        timestep: Time step of the physics, s.
        model: Model of the hole.
        is_judged: True to meter the penetration even if facets make the contacts.
    """
    ring_width = 0.05  # Half the width of a box of the ring, radially, m.
    solref = model.solref(timestep)
    mode = contact.UNPREDICTED if model.hole == "unpredicted" else contact.EXACT
    if model.has_facets:
        mode = contact.PROBE if is_judged else contact.NONE
    shapes = [closed_form("plate", plate, friction, timestep, solref, mode)]
    if not model.has_facets:
        return shapes
    side = (plate.half[0] + 2.0 * ring_width) * math.tan(math.pi / model.facets)
    size, reach = (ring_width, side, plate.depth / 2), plate.half[0] + ring_width
    for k in range(model.facets):
        angle = 2.0 * math.pi / model.facets * k
        at = np.array([reach * math.cos(angle), reach * math.sin(angle), -size[2]])
        shapes.append(_box(size, _pose(plate, at, angle), solref, friction))
    floor = _pose(plate, np.array([0.0, 0.0, -plate.depth - FLOOR]), 0.0)
    return [*shapes, _box((0.02, 0.02, FLOOR), floor, solref, friction)]


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
