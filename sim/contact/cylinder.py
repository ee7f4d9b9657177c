"""Exact contacts between a round peg and plates with one round hole, both with an optional chamfer of 45 degrees.

The features of a cylinder against a half-space with a bore are found in closed form. The set of possible contacts of
the peg's end is complete: every point of the peg's rims must stay out of the plate (`sim.contact.peg_rims`), and every point of
the hole's edges must stay out of the peg's side and chamfer (`sim.contact.hole_edges`). An end has two rims if it is
chamfered, otherwise one. A mouth has two edges if it is chamfered, at the surface and at the bore, otherwise one.

Nearly conformal surfaces (a flat peg on the plate, an aligned peg in the bore, one chamfer in the other) touch along
circles. Fixed samples of the peg's rims and of the hole's edges represent these circles; samples that move with the
tilt would flicker.
"""

import math

from drivers.compiled import njit
from sim.contact.hole_edges import collide_edge
from sim.contact.peg_rims import End, collide_plane, collide_rim
from sim.contact.table import ABOVE, NEAR, NONE, meeting, peg_chamfer, peg_end, plate_at, plate_of
from sim.world import native


def collide(model, data, buffer, geom_plate, geom_peg, margin):  # type: ignore[no-untyped-def]
    """Find every possible contact of the peg's end with the plate, and add it; see `sim.world.native.collide_by`."""
    plate = plate_at(plate_of(model, geom_plate))
    size = native.array(model + native.MODEL_GEOM_SIZE, (geom_peg + 1, 3))[geom_peg]
    r, half, mouth = size[0], size[1], plate.hole + plate.chamfer
    chamfer = peg_chamfer(model, geom_peg)
    e1, e2, v, c, g = peg_end(data, geom_plate, geom_peg, half)
    tilt = math.sqrt(v[0] * v[0] + v[1] * v[1])
    end = End(c, e1, e2, v, r - chamfer, tilt)
    # Lowest point of the cylinder that encloses the chamfered end, a lower bound for the end.
    lowest = c[2] - r * tilt
    if plate.mode == NONE or lowest > ABOVE:
        return 0
    away = math.sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2])
    meet = meeting(model, data, geom_plate, geom_peg, g, max(r + chamfer, away + mouth))
    upper = end
    if chamfer > 0.0:
        upper = End((c[0] + chamfer * v[0], c[1] + chamfer * v[1], c[2] + chamfer * v[2]), e1, e2, v, r, tilt)
    is_beside = math.sqrt(c[0] * c[0] + c[1] * c[1]) > mouth + r + chamfer + NEAR and lowest > -NEAR
    _collide_rim(meet, end, is_beside)
    if chamfer > 0.0:
        _collide_rim(meet, upper, is_beside)
    collide_edge(meet, upper, chamfer, mouth, 0.0)
    if plate.chamfer > 0.0:
        collide_edge(meet, upper, chamfer, plate.hole, -plate.chamfer)
    return 0


@njit(cache=True)
def _collide_rim(meet, rim, is_beside):  # type: ignore[no-untyped-def]
    """Add a rim of the peg against the plane alone if the peg is beside the hole, otherwise against all faces of the plate."""
    if is_beside:
        collide_plane(meet, rim)
    else:
        collide_rim(meet, rim)
