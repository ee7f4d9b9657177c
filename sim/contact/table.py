"""Contacts between a peg and plates with one hole, in MuJoCo's collision table: the part common to all shapes.

If a hole is modelled by soft facets, a peg can fall through its wall. Therefore `sim.contact.cylinder` and
`sim.contact.rectangular` find the touching features of a peg and a half-space with a bore in closed form, inside the
unmodified `mj_step`. `put` makes a contact of each pair of features.

`mj_addContact` also adds contacts with a gap, if the coming steps can close it. The solver then slows the approach
instead of correcting a penetration afterwards.
"""

import math
from typing import NamedTuple

import mujoco
import numpy as np
from numba import carray

from drivers.compiled import njit
from drivers.quantities import Vector
from sim.world import native

PLATE_TYPE = mujoco.mjtGeom.mjGEOM_ELLIPSOID
"""A geom type that no other geom of the scene uses; the plate's ellipsoid is only its bounding volume."""
_WORDS = (
    *("hole", "across", "depth", "friction", "timestep", "stiffness", "damping", "mode", "rub", "rub_damping", "lift"),
    *("middle_x", "middle_y", "half_x", "half_y", "chamfer", "stick", "stick_speed", "ripple", "ripple_length"),
)
PLATE = np.dtype([(name, "f8") for name in _WORDS])
"""Record in a plate's `geom_user`; `plate_user` fills it in."""
PLATE_BYTES = PLATE.itemsize
USER = PLATE_BYTES // 8
"""Length of a plate's `geom_user`, words of 8 bytes."""
EXACT, UNPREDICTED, PROBE, NONE = 0, 1, 2, 3
"""Modes of a plate: closed-form contacts, including those with a gap; only contacts that touch; no contacts, but
metered penetration; nothing."""
PENETRATION = 80
"""Index in `userdata` of the deepest penetration in the bore or at its rim since the last reset to 0, m."""
SURFACE = 81
"""Index in `userdata` of the deepest penetration of a surface or a hole's floor since the last reset to 0, m."""

NEAR = 1e-3
"""Distance above which two features cannot meet in a step, m."""
FEATURE_BAND = 3e-4
"""Gap below which a feature becomes a contact at any approach speed, m. The pivot's friction can accelerate the light
peg's tip to 0.25 m/s within a step of 0.5 ms. Only a contact that exists before the step can stop it."""
SAMPLE_BAND = 2e-5
"""Gap below which a sample becomes a contact at any speed, m; samples only spread the load of conformal surfaces."""
DEEPEST = 1e-3
"""Depth in the plate or in the wall of its bore beyond which a point makes no contact, m. Such a point has entered through
the plate's side, which is not modelled, or through the plate. The trial becomes void; a contact force at this depth would
throw the arm (decision 0002)."""
ENDLESS = (0.0, 0.0, 0.1, 0.1)
"""Outline of a plate with edges out of the peg's reach: centre and half the extents along x and y, m, plate frame."""
ABOVE = 2e-3
"""Height of the peg's lowest point above the surface, m; beyond it nothing can touch in one step."""
IMPEDANCE = 0.9999
"""Constraint impedance of the contacts, the maximum of MuJoCo, fraction."""
FRICTION_LAG = 4.0
"""Response time of friction to a change of the sliding speed, multiple of the normal force's response time to the
approach. A larger value makes a sliding peg hover less (see `put`), and sink less if its speed changes in a step."""
SOLID = -1.0
"""Half extent of a plate without a hole, m; negative, so that the plane is nearer to the peg's end than a wall."""
FRICTION_FLOOR = 1e-5
"""Lower bound of a contact's friction, ratio; a contact with friction 0 vanishes in MuJoCo's elliptic cone."""


class Rubbing(NamedTuple):
    """Change of a plate's friction with the sliding speed and the position; the last part of the record of `PLATE`."""

    stick: float
    """Friction at rest divided by friction of fast sliding, minus 1, ratio."""
    stick_speed: float
    """Sliding speed at which `stick` has fallen to 1/e, m/s."""
    ripple: float
    """Amplitude of the friction's variation over the surface, fraction."""
    ripple_length: float
    """Period of `ripple` along x and along y, m."""


EVEN = Rubbing(0.0, 1.0, 0.0, 1.0)
"""Coulomb's law, the same at every position."""


class Meeting(NamedTuple):
    """A plate and a peg in the search for contacts; it holds plain numbers, because compiled code passes them fast."""

    model: int
    """Address of the mjModel."""
    data: int
    """Address of the mjData."""
    plate: int
    """Address of the plate's `geom_user`, a record of `PLATE`."""
    userdata: int
    """Address of MuJoCo's `userdata`; it begins with the contact to fill in, a record of `native.CONTACT`."""
    hole: float
    """Half the extent of the hole along x: its radius, or half its first side, m."""
    across: float
    """Half the extent along y, m."""
    depth: float
    """Depth of the hole's floor, m."""
    chamfer: float
    """Width and depth of the chamfer at the hole's mouth, m."""
    origin: tuple[float, float, float]
    """Centre of the hole's mouth, m, base frame."""
    rows: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
    """Rows of the rotation matrix from the plate's frame to the base frame."""
    centre: tuple[float, float, float]
    """Reference point of `velocity`, m, base frame."""
    turning: tuple[float, float, float]
    """Angular velocity of the peg, rad/s, base frame."""
    velocity: tuple[float, float, float]
    """Velocity of the peg at `centre`, m/s, base frame."""
    reach: float
    """Largest gap that any point of the peg's end can close in the coming steps, m; `put` adds the feature's own band."""


def plate_user(
    half: tuple[float, float],
    hole_depth: float,
    friction: float,
    timestep: float,
    solref: tuple[float, float] | None = None,
    mode: int = EXACT,
    outline: tuple[float, float, float, float] = ENDLESS,
    chamfer: float = 0.0,
    rubbing: Rubbing = EVEN,
) -> Vector:
    """Return a plate's `geom_user`, shape (USER,); the plate's frame has its origin at the centre of the hole's mouth,
    z outward.

    Args:
        half: Half the extents of the hole along x and y, m.
        hole_depth: Depth of the floor under the surface, m.
        friction: Coulomb coefficient between plate and peg.
        timestep: Time step of the model, s; contacts look ahead by multiples of it.
        solref: Stiffness of the contacts in MuJoCo's terms; None is the stiffest of its standard form.
        mode: EXACT, UNPREDICTED, PROBE or NONE.
        outline: Rectangle of the plate: centre and half the extents along x and y, m, plate frame; no contacts outside.
        chamfer: Width and depth of the chamfer of 45 degrees at the mouth of a round hole, m.
        rubbing: Change of the friction with speed and position.
    """
    first, second = solref or (2.0 * timestep, 1.0)
    # MuJoCo's k and b: for (tau, zeta) they are 1/(d tau zeta)^2 and 2/(d tau), for (-k, -b) they are k/d^2 and b/d.
    if first > 0.0:
        rub, lift = (FRICTION_LAG * first, second), 2.0 * IMPEDANCE * first * second * second
    else:
        rub, lift = (first, second / FRICTION_LAG), IMPEDANCE * second / first
    ends = (*rub, lift / FRICTION_LAG, *outline, chamfer, *rubbing)
    values = (*half, hole_depth, max(friction, FRICTION_FLOOR), timestep, first, second, mode, *ends)
    return np.array(values, dtype=float)


@njit(cache=True, inline="always")
def plate_of(model, geom):  # type: ignore[no-untyped-def]
    """Return the address of a plate's `geom_user`."""
    return native.load(model + native.MODEL_GEOM_USER) + PLATE_BYTES * geom


@njit(cache=True)
def plate_at(address):  # type: ignore[no-untyped-def]
    """Return the plate's `geom_user` at an address, a record of `PLATE`."""
    return carray(native.pointer(address), (1,), PLATE)[0]


@njit(cache=True, inline="always")
def peg_chamfer(model, geom):  # type: ignore[no-untyped-def]
    """Return the chamfer of a peg, m, the first word of its own `geom_user`; see `sim.contact.shapes.peg_geom`."""
    return carray(native.pointer(plate_of(model, geom)), (1,), np.float64)[0]


@njit(cache=True, inline="always")
def peg_end(data, geom_plate, geom_peg, half):  # type: ignore[no-untyped-def]
    """Return the pose of a peg's end relative to a plate; `half` is half the peg's length, m.

    Returns:
        The axes e1 and e2 in the end face, v away from the end, and the centre c of the end, m, all in the plate's
        frame; then the vector from the plate's origin to c, m, base frame.
    """
    last = max(geom_plate, geom_peg) + 1
    places = native.array(data + native.DATA_GEOM_XPOS, (last, 3))
    axes = native.array(data + native.DATA_GEOM_XMAT, (last, 3, 3))
    R, A, middle, origin = axes[geom_plate], axes[geom_peg], places[geom_peg], places[geom_plate]
    g = (
        middle[0] - half * A[0, 2] - origin[0],
        middle[1] - half * A[1, 2] - origin[1],
        middle[2] - half * A[2, 2] - origin[2],
    )
    return _inside(R, A[:, 0]), _inside(R, A[:, 1]), _inside(R, A[:, 2]), _inside(R, g), g


@njit(cache=True, inline="always")
def _inside(R, w):  # type: ignore[no-untyped-def]
    """Transform a vector from the base frame to the frame whose axes are the columns of R."""
    return (
        R[0, 0] * w[0] + R[1, 0] * w[1] + R[2, 0] * w[2],
        R[0, 1] * w[0] + R[1, 1] * w[1] + R[2, 1] * w[2],
        R[0, 2] * w[0] + R[1, 2] * w[1] + R[2, 2] * w[2],
    )


@njit(cache=True, inline="always")
def meeting(model, data, geom_plate, geom_peg, g, lever):  # type: ignore[no-untyped-def]
    """Return the `Meeting` of two geoms.

    Args:
        model: Address of the mjModel.
        data: Address of the mjData.
        geom_plate: The plate's geom.
        geom_peg: The peg's geom.
        g: Vector from the plate's origin to the centre of the peg's end, m, base frame.
        lever: Largest distance of a contact point from the centre of the peg's end, m.
    """
    # MuJoCo finds contacts before it computes velocities; without this call the velocities would be those of the last step.
    native.update_velocities(model, data)
    body = carray(native.pointer(native.load(model + native.MODEL_GEOM_BODYID)), (geom_peg + 1,), np.int32)[geom_peg]
    root = carray(native.pointer(native.load(model + native.MODEL_BODY_ROOTID)), (body + 1,), np.int32)[body]
    cvel = native.array(data + native.DATA_CVEL, (body + 1, 6))[body]
    com = native.array(data + native.DATA_SUBTREE_COM, (root + 1, 3))[root]
    origin = native.array(data + native.DATA_GEOM_XPOS, (geom_plate + 1, 3))[geom_plate]
    R = native.array(data + native.DATA_GEOM_XMAT, (geom_plate + 1, 3, 3))[geom_plate]
    address, userdata = plate_of(model, geom_plate), native.load(data + native.DATA_USERDATA)
    plate = plate_at(address)
    _prepare(_contact_at(userdata), plate, geom_plate, geom_peg)
    return Meeting(
        model,
        data,
        address,
        userdata,
        plate.hole,
        plate.across,
        plate.depth,
        plate.chamfer,
        (origin[0], origin[1], origin[2]),
        ((R[0, 0], R[0, 1], R[0, 2]), (R[1, 0], R[1, 1], R[1, 2]), (R[2, 0], R[2, 1], R[2, 2])),
        (com[0], com[1], com[2]),
        (cvel[0], cvel[1], cvel[2]),
        (cvel[3], cvel[4], cvel[5]),
        _reach(cvel, com, origin, g, lever, plate.timestep),
    )


@njit(cache=True)
def _contact_at(userdata):  # type: ignore[no-untyped-def]
    """Return the contact to fill in, a record of `native.CONTACT`."""
    return carray(native.pointer(userdata), (1,), native.CONTACT)[0]


@njit(cache=True, inline="always")
def _prepare(contact, plate, geom_plate, geom_peg):  # type: ignore[no-untyped-def]
    """Write the fields common to all contacts of two geoms; `mj_addContact` copies them."""
    contact.includemargin = contact.adhesion = contact.mu = 0.0
    friction, solref, solimp = contact.friction, contact.solref, contact.solimp
    friction[0] = friction[1] = plate.friction
    friction[2] = friction[3] = friction[4] = FRICTION_FLOOR
    solref[0], solref[1] = plate.stiffness, plate.damping
    contact.solreffriction[0], contact.solreffriction[1] = plate.rub, plate.rub_damping
    solimp[0] = solimp[1] = IMPEDANCE
    solimp[2], solimp[3], solimp[4] = 1e-3, 0.5, 2.0
    contact.H[:] = 0.0
    contact.dim = 3
    contact.geom1 = contact.geom[0] = geom_plate
    contact.geom2 = contact.geom[1] = geom_peg
    contact.flex[:] = contact.elem[:] = contact.vert[:] = -1
    contact.exclude, contact.efc_address = 0, -1


@njit(cache=True, inline="always")
def _reach(cvel, com, origin, g, lever, timestep):  # type: ignore[no-untyped-def]
    """Return the largest gap, m, that a point at the distance `lever` from the centre of the peg's end can close.

    Args:
        cvel: Angular, then linear velocity of the peg at `com`, rad/s and m/s.
        com: Point that `cvel` refers to, m, base frame.
        origin: Origin of the plate, m, base frame.
        g: Vector from the plate's origin to the centre of the peg's end, m, base frame.
        lever: Distance of the point from the centre of the peg's end, m.
        timestep: Time step of the model, s.
    """
    r0, r1, r2 = g[0] + origin[0] - com[0], g[1] + origin[1] - com[1], g[2] + origin[2] - com[2]
    # Velocity of the end's centre: v_c = v + omega × r.
    x = cvel[3] + cvel[1] * r2 - cvel[2] * r1
    y = cvel[4] + cvel[2] * r0 - cvel[0] * r2
    z = cvel[5] + cvel[0] * r1 - cvel[1] * r0
    turning = math.sqrt(cvel[0] * cvel[0] + cvel[1] * cvel[1] + cvel[2] * cvel[2])
    # reach = 4 dt (|v_c| + |omega| lever); the additions allow for rounding.
    return 4.001 * timestep * (math.sqrt(x * x + y * y + z * z) + turning * lever) + 1e-9


@njit(cache=True)
def put(meeting, gap, p, n, kind, band):  # type: ignore[no-untyped-def]
    """Add a contact if the coming steps can close the gap.

    Args:
        meeting: Pair of plate and peg.
        gap: Distance of the two features, m, negative if they penetrate.
        p: Point of the peg, m, plate frame.
        n: Normal from plate to peg, plate frame.
        kind: Kind of the penetration, PENETRATION or SURFACE.
        band: Gap below which the pair is a contact at any approach speed, m.
    """
    plate = plate_at(meeting.plate)
    deepest = carray(native.pointer(meeting.userdata), (native.NUSERDATA,), np.float64)
    if abs(p[0] - plate.middle_x) > plate.half_x or abs(p[1] - plate.middle_y) > plate.half_y:
        return
    counted = PENETRATION if gap < -DEEPEST else kind
    deepest[counted] = max(deepest[counted], -gap)
    if gap < -DEEPEST or gap > band + meeting.reach or plate.mode == PROBE or (plate.mode == UNPREDICTED and gap > 0.0):
        return
    origin, (x, y, z) = meeting.origin, meeting.rows
    # Point and normal in the base frame: X = o + R p, N = R n.
    X0 = origin[0] + x[0] * p[0] + x[1] * p[1] + x[2] * p[2]
    X1 = origin[1] + y[0] * p[0] + y[1] * p[1] + y[2] * p[2]
    X2 = origin[2] + z[0] * p[0] + z[1] * p[1] + z[2] * p[2]
    N0 = x[0] * n[0] + x[1] * n[1] + x[2] * n[2]
    N1 = y[0] * n[0] + y[1] * n[1] + y[2] * n[2]
    N2 = z[0] * n[0] + z[1] * n[1] + z[2] * n[2]
    base, omega, v = meeting.centre, meeting.turning, meeting.velocity
    r0, r1, r2 = X0 - base[0], X1 - base[1], X2 - base[2]
    # Velocity of the point: v_X = v + omega × (X - centre); its normal part is the speed of separation.
    v0 = v[0] + omega[1] * r2 - omega[2] * r1
    v1 = v[1] + omega[2] * r0 - omega[0] * r2
    v2 = v[2] + omega[0] * r1 - omega[1] * r0
    speed = N0 * v0 + N1 * v1 + N2 * v2
    # With solref (2 dt, 1) the constraint acts if the approach closes more than a quarter of the gap in a step.
    if gap > band - 4.0 * plate.timestep * min(speed, 0.0):
        return
    # Any tangent is valid, because the friction cone is isotropic.
    if abs(N0) <= abs(N1) and abs(N0) <= abs(N2):
        t0, t1, t2 = 0.0, N2, -N1
    elif abs(N1) <= abs(N2):
        t0, t1, t2 = -N2, 0.0, N0
    else:
        t0, t1, t2 = N1, -N0, 0.0
    scale = 1.0 / math.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
    t0, t1, t2 = t0 * scale, t1 * scale, t2 * scale
    contact = _contact_at(meeting.userdata)
    sliding = math.sqrt(max(v0 * v0 + v1 * v1 + v2 * v2 - speed * speed, 0.0))
    mu = plate.friction
    if plate.stick > 0.0 or plate.ripple > 0.0:
        # mu(v, x, y) = mu (1 + s exp(-(v / vs)²)) (1 + a sin(2 pi x / l) sin(2 pi y / l)): Stribeck's law, and a pattern of the surface.
        wave = 2.0 * math.pi / plate.ripple_length
        mu *= 1.0 + plate.stick * math.exp(-((sliding / plate.stick_speed) ** 2))
        mu *= 1.0 + plate.ripple * math.sin(wave * p[0]) * math.sin(wave * p[1])
        contact.friction[0] = contact.friction[1] = max(mu, FRICTION_FLOOR)
    # MuJoCo's convex friction cone lifts a sliding contact by `lift` times mu times its speed. The contact's distance
    # is increased by the same amount, so that the peg lies on the surface. Rim and wall have no such term, because a
    # decelerating peg would sink in.
    upward = max(n[2], 0.0) if kind == SURFACE else 0.0
    contact.dist = gap + plate.lift * mu * sliding * upward * upward
    pos, frame = contact.pos, contact.frame
    pos[0], pos[1], pos[2] = X0 - 0.5 * gap * N0, X1 - 0.5 * gap * N1, X2 - 0.5 * gap * N2
    frame[0], frame[1], frame[2] = N0, N1, N2
    frame[3], frame[4], frame[5] = t0, t1, t2
    frame[6], frame[7], frame[8] = N1 * t2 - N2 * t1, N2 * t0 - N0 * t2, N0 * t1 - N1 * t0
    native.add_contact(meeting.model, meeting.data, meeting.userdata)
