"""Exact contacts between a peg and plates with one round hole, hung into MuJoCo's own collision table.

Soft, faceted holes let a peg fall through the wall; here the features of a cylinder against a
half-space with a bore are found in closed form, inside an untouched `mj_step`. The set of places where
the peg's end may touch is complete: every point of the peg's rim must stay out of the solid
{z < 0, rho > R}, so its clearance is g = max(z, R - rho), and every point of the hole's edge must stay
out of the peg's side. The local minima of g over the rim are rim on plane (z decides), rim on wall
(R - rho decides) and, where both are equal, edge on edge, whose normal is the convex combination of the
two that is perpendicular to the rim: the cross product of the two edges' tangents.

Contacts are added with `mj_addContact` also while still apart, by up to what the coming steps can close:
the solver then slows the approach instead of repairing a penetration after it. Nearly conformal
surfaces (a flat peg on the plate, an aligned peg in the bore) touch along circles, for which fixed samples
of the peg's rim and of the hole's edge stand; samples that move with the tilt would flicker.
"""

import math

import mujoco
import numpy as np
from numba import carray, types

from drivers.compiled import cfunc, njit
from drivers.quantities import Vector
from sim import flats, native

PLATE_TYPE = mujoco.mjtGeom.mjGEOM_ELLIPSOID
PEG_TYPE = mujoco.mjtGeom.mjGEOM_CYLINDER
"""A pair of geom types that nothing else in the scene uses; the plate's ellipsoid is only its bounding volume."""

USER = 8
"""Length of a plate's `geom_user`: hole radius, hole depth, friction, time step, the contacts' two `solref`, mode, flats."""
EXACT, UNPREDICTED, PROBE, NONE = 0, 1, 2, 3
"""Modes: contacts in closed form; the same without those that are still apart; no contacts, only the penetration is
told; nothing."""
PENETRATION = 80
"""Index in `userdata` of the deepest penetration in the bore or at its rim since it was last set to 0, m."""

SCAN = 48
SAMPLE_EVERY = 3
"""Of the points that are scanned for minima, every third is also a contact where surfaces are nearly conformal."""
NEAR = 1e-3
"""Features further apart than this cannot meet in a step, m."""
FEATURE_BAND = 3e-4
"""Gap below which a feature is a contact whatever its speed, m: the pivot's friction can give the light peg's tip
0.25 m/s within a step of 0.5 ms, and a constraint that is not there cannot stop it."""
SAMPLE_BAND = 2e-5
"""The same for a sample, which only spreads the load of nearly conformal surfaces, m."""
IMPEDANCE = 0.9999
"""Largest that MuJoCo allows."""
SOLID = -1.0
"""Radius of a hole that is not there, m: for every point of the peg's end the plane is nearer than such a wall."""
FRICTION_FLOOR = 1e-5
"""A contact with friction 0 vanishes in MuJoCo's elliptic cone."""

_ANGLE = 2.0 * math.pi / SCAN
_COS = np.cos(_ANGLE * np.arange(SCAN))
_SIN = np.sin(_ANGLE * np.arange(SCAN))


def plate_user(
    hole_radius: float,
    hole_depth: float,
    friction: float,
    timestep: float,
    solref: tuple[float, float] | None = None,
    mode: int = EXACT,
    has_flats: bool = False,
) -> Vector:
    """Return a plate's `geom_user`, shape (8,); the plate's frame has its origin at the middle of the hole's mouth, z outward.

    Args:
        hole_radius: m.
        hole_depth: Depth of the floor under the surface, m.
        friction: Coulomb coefficient between plate and peg.
        timestep: Of the model, s; contacts look ahead by it.
        solref: Stiffness of the contacts in MuJoCo's terms; without it the stiffest that its standard form allows.
        mode: EXACT, UNPREDICTED, PROBE or NONE.
        has_flats: Whether the boxes of `sim.flats` follow the plate's geom.
    """
    first, second = solref or (2.0 * timestep, 1.0)
    return np.array([hole_radius, hole_depth, max(friction, FRICTION_FLOOR), timestep, first, second, mode, has_flats])


@njit(cache=True)
def put(model, data, scratch, ids, frame, twist, user, gap, p, n, judged, band):  # type: ignore[no-untyped-def]
    """Add a contact where the coming steps could close `gap`; p and n in the plate's frame, n from plate to peg."""
    origin, R = frame
    base, omega, v, reach = twist
    if judged and -gap > scratch[PENETRATION]:
        scratch[PENETRATION] = -gap
    if gap > band + reach or user[6] == PROBE or (user[6] == UNPREDICTED and gap > 0.0):
        return
    timestep = user[3]
    X0 = origin[0] + R[0, 0] * p[0] + R[0, 1] * p[1] + R[0, 2] * p[2]
    X1 = origin[1] + R[1, 0] * p[0] + R[1, 1] * p[1] + R[1, 2] * p[2]
    X2 = origin[2] + R[2, 0] * p[0] + R[2, 1] * p[1] + R[2, 2] * p[2]
    N0 = R[0, 0] * n[0] + R[0, 1] * n[1] + R[0, 2] * n[2]
    N1 = R[1, 0] * n[0] + R[1, 1] * n[1] + R[1, 2] * n[2]
    N2 = R[2, 0] * n[0] + R[2, 1] * n[1] + R[2, 2] * n[2]
    r0, r1, r2 = X0 - base[0], X1 - base[1], X2 - base[2]
    speed = (
        N0 * (v[0] + omega[1] * r2 - omega[2] * r1)
        + N1 * (v[1] + omega[2] * r0 - omega[0] * r2)
        + N2 * (v[2] + omega[0] * r1 - omega[1] * r0)
    )
    # With solref (2 dt, 1) the constraint bites where the approach is faster than a quarter of the gap a step.
    if gap > band - 4.0 * timestep * min(speed, 0.0):
        return
    # Any tangent serves, the friction cone is isotropic.
    if abs(N0) <= abs(N1) and abs(N0) <= abs(N2):
        t0, t1, t2 = 0.0, N2, -N1
    elif abs(N1) <= abs(N2):
        t0, t1, t2 = -N2, 0.0, N0
    else:
        t0, t1, t2 = N1, -N0, 0.0
    scale = 1.0 / math.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
    t0, t1, t2 = t0 * scale, t1 * scale, t2 * scale
    scratch[0] = gap
    scratch[1], scratch[2], scratch[3] = X0 - 0.5 * gap * N0, X1 - 0.5 * gap * N1, X2 - 0.5 * gap * N2
    scratch[4], scratch[5], scratch[6] = N0, N1, N2
    scratch[7], scratch[8], scratch[9] = t0, t1, t2
    scratch[10], scratch[11], scratch[12] = N1 * t2 - N2 * t1, N2 * t0 - N0 * t2, N0 * t1 - N1 * t0
    scratch[13] = 0.0
    scratch[14] = scratch[15] = user[2]
    scratch[16] = scratch[17] = scratch[18] = FRICTION_FLOOR
    scratch[19], scratch[20] = user[4], user[5]
    scratch[21] = scratch[22] = 0.0
    scratch[23] = scratch[24] = IMPEDANCE
    scratch[25], scratch[26], scratch[27] = 1e-3, 0.5, 2.0
    for i in range(28, native.CONTACT_WORDS):
        scratch[i] = 0.0
    ids[0] = 3
    ids[5] = ids[6] = ids[7] = ids[8] = ids[9] = ids[10] = -1
    ids[11] = 0
    ids[12] = -1
    native.add_contact(model, data, scratch.ctypes.data)


@njit(cache=True)
def _rim(c, e1, e2, r, cosine, sine):  # type: ignore[no-untyped-def]
    """Return a point of the peg's rim and how it changes with the angle, plate frame."""
    p = (
        c[0] + r * (cosine * e1[0] + sine * e2[0]),
        c[1] + r * (cosine * e1[1] + sine * e2[1]),
        c[2] + r * (cosine * e1[2] + sine * e2[2]),
    )
    dp = (
        r * (cosine * e2[0] - sine * e1[0]),
        r * (cosine * e2[1] - sine * e1[1]),
        r * (cosine * e2[2] - sine * e1[2]),
    )
    return p, dp


@njit(cache=True)
def _inward(p, rho):  # type: ignore[no-untyped-def]
    """Return the wall's normal at a point, into the bore; a point on the hole's axis touches no wall."""
    if rho < 1e-12:
        return (0.0, 0.0, 1.0)
    return (-p[0] / rho, -p[1] / rho, 0.0)


@njit(cache=True)
def collide(model, data, geom_plate, geom_peg):  # type: ignore[no-untyped-def]
    """Find every place where the end of the peg may touch the plate, and add it as a contact."""
    users = carray(native.pointer(native.load(model + native.MODEL_GEOM_USER)), (geom_plate + 1, USER), np.float64)
    user = users[geom_plate]
    xpos = carray(
        native.pointer(native.load(data + native.DATA_GEOM_XPOS)), (max(geom_plate, geom_peg) + 1, 3), np.float64
    )
    xmat = carray(
        native.pointer(native.load(data + native.DATA_GEOM_XMAT)), (max(geom_plate, geom_peg) + 1, 3, 3), np.float64
    )
    size = carray(native.pointer(native.load(model + native.MODEL_GEOM_SIZE)), (geom_peg + 1, 3), np.float64)
    origin, R, A, middle = xpos[geom_plate], xmat[geom_plate], xmat[geom_peg], xpos[geom_peg]
    r, half = size[geom_peg, 0], size[geom_peg, 1]
    hole = user[0]
    # The peg's end frame in the plate's frame: c the middle of the end face, v the axis away from it.
    E = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            E[i, j] = R[0, i] * A[0, j] + R[1, i] * A[1, j] + R[2, i] * A[2, j]
    e1, e2, v = (E[0, 0], E[1, 0], E[2, 0]), (E[0, 1], E[1, 1], E[2, 1]), (E[0, 2], E[1, 2], E[2, 2])
    g = (
        middle[0] - half * A[0, 2] - origin[0],
        middle[1] - half * A[1, 2] - origin[1],
        middle[2] - half * A[2, 2] - origin[2],
    )
    c = (
        R[0, 0] * g[0] + R[1, 0] * g[1] + R[2, 0] * g[2],
        R[0, 1] * g[0] + R[1, 1] * g[1] + R[2, 1] * g[2],
        R[0, 2] * g[0] + R[1, 2] * g[1] + R[2, 2] * g[2],
    )
    if user[7] > 0.0:
        xpos = carray(
            native.pointer(native.load(data + native.DATA_GEOM_XPOS)), (geom_plate + 1 + flats.FLATS, 3), np.float64
        )
        xmat = carray(
            native.pointer(native.load(data + native.DATA_GEOM_XMAT)), (geom_plate + 1 + flats.FLATS, 3, 3), np.float64
        )
        flats.aim(c, e1, e2, v, r, hole, origin, R, xpos, xmat, geom_plate + 1)
    tilt = math.sqrt(v[0] * v[0] + v[1] * v[1])
    if user[6] == NONE or c[2] - r * tilt > 2e-3:
        return

    bodies = carray(native.pointer(native.load(model + native.MODEL_GEOM_BODYID)), (geom_peg + 1,), np.int32)
    body = bodies[geom_peg]
    roots = carray(native.pointer(native.load(model + native.MODEL_BODY_ROOTID)), (body + 1,), np.int32)
    cvel = carray(native.pointer(native.load(data + native.DATA_CVEL)), (body + 1, 6), np.float64)[body]
    com = carray(native.pointer(native.load(data + native.DATA_SUBTREE_COM)), (body + 1, 3), np.float64)[roots[body]]
    away = math.sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2])
    reach = _reach(cvel, com, origin, g, max(r, away + hole), user[3])
    twist = ((com[0], com[1], com[2]), (cvel[0], cvel[1], cvel[2]), (cvel[3], cvel[4], cvel[5]), reach)
    address = native.load(data + native.DATA_USERDATA)
    scratch = carray(native.pointer(address), (native.NUSERDATA,), np.float64)
    ids = carray(native.pointer(address + 8 * native.CONTACT_WORDS), (14,), np.int32)
    ids[1] = ids[3] = geom_plate
    ids[2] = ids[4] = geom_peg
    frame = (origin, R)
    up = (0.0, 0.0, 1.0)

    if math.sqrt(c[0] * c[0] + c[1] * c[1]) > hole + r + NEAR and c[2] - r * tilt > -NEAR:
        # All of the rim over solid plate: only the plane is left.
        for i in range(0, SCAN, SAMPLE_EVERY):
            if c[2] + r * (_COS[i] * e1[2] + _SIN[i] * e2[2]) <= SAMPLE_BAND + reach:
                p, _ = _rim(c, e1, e2, r, _COS[i], _SIN[i])
                put(model, data, scratch, ids, frame, twist, user, p[2], p, up, False, SAMPLE_BAND)
        if tilt > 1e-9:
            p = _lowest(c, e1, e2, r)
            put(model, data, scratch, ids, frame, twist, user, p[2], p, up, False, FEATURE_BAND)
    else:
        _collide_rim(model, data, scratch, ids, frame, twist, user, c, e1, e2, r, tilt)
    # The hole's edge is nowhere above the end face, or everywhere far from the peg's axis.
    along = -c[0] * v[0] - c[1] * v[1] - c[2] * v[2]
    beside = math.sqrt(max(away * away - along * along, 0.0))
    if along + hole * tilt > -1e-9 and beside <= hole + r + max(NEAR, FEATURE_BAND + reach):
        _collide_edge(model, data, scratch, ids, frame, twist, user, c, v, r)


@njit(cache=True)
def _reach(cvel, com, origin, g, lever, timestep):  # type: ignore[no-untyped-def]
    """Return how wide a gap may be, m, that a point `lever` from the middle of the peg's end approaches fast enough.

    Args:
        cvel: Angular, then linear velocity of the peg at `com`.
        com: m, base frame.
        origin: Of the plate, m, base frame.
        g: The middle of the peg's end from there, m, base frame.
        lever: m.
        timestep: s.
    """
    r0, r1, r2 = g[0] + origin[0] - com[0], g[1] + origin[1] - com[1], g[2] + origin[2] - com[2]
    x = cvel[3] + cvel[1] * r2 - cvel[2] * r1
    y = cvel[4] + cvel[2] * r0 - cvel[0] * r2
    z = cvel[5] + cvel[0] * r1 - cvel[1] * r0
    turning = math.sqrt(cvel[0] * cvel[0] + cvel[1] * cvel[1] + cvel[2] * cvel[2])
    # Some more, for rounding.
    return 4.001 * timestep * (math.sqrt(x * x + y * y + z * z) + turning * lever) + 1e-9


@njit(cache=True)
def _lowest(c, e1, e2, r):  # type: ignore[no-untyped-def]
    """Return the lowest point of a tilted rim, in closed form."""
    cosine = -e1[2] / math.sqrt(e1[2] * e1[2] + e2[2] * e2[2])
    sine = -e2[2] / math.sqrt(e1[2] * e1[2] + e2[2] * e2[2])
    p, _ = _rim(c, e1, e2, r, cosine, sine)
    return p


@njit(cache=True)
def _collide_rim(model, data, scratch, ids, frame, twist, user, c, e1, e2, r, tilt):  # type: ignore[no-untyped-def]
    """Add the peg's rim against plane, wall, edge and floor."""
    hole, depth = user[0], user[1]
    up = (0.0, 0.0, 1.0)
    Z, W = np.empty(SCAN), np.empty(SCAN)
    for i in range(SCAN):
        p, _ = _rim(c, e1, e2, r, _COS[i], _SIN[i])
        rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
        Z[i], W[i] = p[2], hole - rho
        if i % SAMPLE_EVERY == 0:
            if Z[i] >= W[i]:
                put(model, data, scratch, ids, frame, twist, user, Z[i], p, up, False, SAMPLE_BAND)
            else:
                put(model, data, scratch, ids, frame, twist, user, W[i], p, _inward(p, rho), True, SAMPLE_BAND)
                put(model, data, scratch, ids, frame, twist, user, Z[i] + depth, p, up, False, SAMPLE_BAND)
    if tilt > 1e-9:
        p = _lowest(c, e1, e2, r)
        rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
        if p[2] >= hole - rho:
            put(model, data, scratch, ids, frame, twist, user, p[2], p, up, False, FEATURE_BAND)
        else:
            put(model, data, scratch, ids, frame, twist, user, p[2] + depth, p, up, False, FEATURE_BAND)
    for i in range(SCAN):
        j = (i + 1) % SCAN
        h = (i - 1) % SCAN
        if W[i] <= W[h] and W[i] < W[j] and abs(W[i]) < NEAR:
            # Rim on wall: Newton on d(rho^2)/d(angle); where the plane decides there, it is no minimum.
            angle = i * _ANGLE
            for _ in range(4):
                p, dp = _rim(c, e1, e2, r, math.cos(angle), math.sin(angle))
                slope = p[0] * dp[0] + p[1] * dp[1]
                bend = dp[0] * dp[0] + dp[1] * dp[1] - p[0] * (p[0] - c[0]) - p[1] * (p[1] - c[1])
                if bend >= 0.0:
                    break
                angle -= min(max(slope / bend, -_ANGLE), _ANGLE)
            p, dp = _rim(c, e1, e2, r, math.cos(angle), math.sin(angle))
            rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
            if hole - rho > p[2]:
                put(model, data, scratch, ids, frame, twist, user, hole - rho, p, _inward(p, rho), True, FEATURE_BAND)
        if (Z[i] >= W[i]) != (Z[j] >= W[j]) and max(Z[i], W[i]) < NEAR + r * _ANGLE:
            # Edge on edge: where plane and wall are equally far, by regula falsi (Illinois).
            lo, hi = i * _ANGLE, (i + 1) * _ANGLE
            flo, fhi = Z[i] - W[i], Z[j] - W[j]
            angle = lo
            for _ in range(8):
                angle = (lo * fhi - hi * flo) / (fhi - flo)
                p, dp = _rim(c, e1, e2, r, math.cos(angle), math.sin(angle))
                f = p[2] - hole + math.sqrt(p[0] * p[0] + p[1] * p[1])
                if f * fhi > 0.0:
                    hi, fhi, flo = angle, f, 0.5 * flo
                else:
                    lo, flo, fhi = angle, f, 0.5 * fhi
                if abs(f) < 1e-10:
                    break
            rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
            if rho > 1e-9:
                dz = dp[2]
                dw = -(p[0] * dp[0] + p[1] * dp[1]) / rho
                if dz * dw < 0.0:
                    share = dw / (dw - dz)
                    norm = math.sqrt(share * share + (1.0 - share) * (1.0 - share))
                    wall = _inward(p, rho)
                    n = ((1.0 - share) / norm * wall[0], (1.0 - share) / norm * wall[1], share / norm)
                    put(
                        model,
                        data,
                        scratch,
                        ids,
                        frame,
                        twist,
                        user,
                        max(p[2], hole - rho) / norm,
                        p,
                        n,
                        True,
                        FEATURE_BAND,
                    )


@njit(cache=True)
def _collide_edge(model, data, scratch, ids, frame, twist, user, c, v, r):  # type: ignore[no-untyped-def]
    """Add the hole's edge against the peg's side: distance from the peg's axis less its radius, above the end face."""
    hole = user[0]
    Z, W = np.empty(SCAN), np.empty(SCAN)
    for i in range(SCAN):
        _edge_sample(c, v, r, hole, i, Z, W)
    for i in range(SCAN):
        # Z: height above the end face along the axis; W: clearance from the side.
        if i % SAMPLE_EVERY == 0:
            _put_edge(model, data, scratch, ids, frame, twist, user, c, v, r, hole, _COS[i], _SIN[i], SAMPLE_BAND)
        j = (i + 1) % SCAN
        h = (i - 1) % SCAN
        if W[i] <= W[h] and W[i] < W[j] and abs(W[i]) < NEAR:
            # Newton on the squared distance from the axis.
            angle = i * _ANGLE
            for _ in range(4):
                cosine, sine = math.cos(angle), math.sin(angle)
                q = (hole * cosine - c[0], hole * sine - c[1], -c[2])
                dq = (-hole * sine, hole * cosine)
                along = q[0] * v[0] + q[1] * v[1] + q[2] * v[2]
                dalong = dq[0] * v[0] + dq[1] * v[1]
                slope = q[0] * dq[0] + q[1] * dq[1] - along * dalong
                bend = (
                    dq[0] * dq[0]
                    + dq[1] * dq[1]
                    - q[0] * hole * cosine
                    - q[1] * hole * sine
                    - dalong * dalong
                    + along * hole * (cosine * v[0] + sine * v[1])
                )
                if bend <= 0.0:
                    break
                angle -= min(max(slope / bend, -_ANGLE), _ANGLE)
            _put_edge(
                model,
                data,
                scratch,
                ids,
                frame,
                twist,
                user,
                c,
                v,
                r,
                hole,
                math.cos(angle),
                math.sin(angle),
                FEATURE_BAND,
            )


@njit(cache=True)
def _edge_sample(c, v, r, hole, i, Z, W):  # type: ignore[no-untyped-def]
    """Write where a point of the hole's edge is along the peg's axis, and its clearance from the peg's side."""
    q = (hole * _COS[i] - c[0], hole * _SIN[i] - c[1], -c[2])
    along = q[0] * v[0] + q[1] * v[1] + q[2] * v[2]
    Z[i] = along
    W[i] = math.sqrt(max(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] - along * along, 0.0)) - r


@njit(cache=True)
def _put_edge(model, data, scratch, ids, frame, twist, user, c, v, r, hole, cosine, sine, band):  # type: ignore[no-untyped-def]
    """Add the peg's side against one point of the hole's edge."""
    p = (hole * cosine, hole * sine, 0.0)
    q = (p[0] - c[0], p[1] - c[1], -c[2])
    along = q[0] * v[0] + q[1] * v[1] + q[2] * v[2]
    if along <= 0.0:
        return
    n = (along * v[0] - q[0], along * v[1] - q[1], along * v[2] - q[2])
    distance = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    if distance < 1e-9 or distance - r < -along:
        return
    n = (n[0] / distance, n[1] / distance, n[2] / distance)
    put(model, data, scratch, ids, frame, twist, user, distance - r, p, n, True, band)


@cfunc(types.int32(types.intp, types.intp, types.intp, types.int32, types.int32, types.float64), cache=True)
def _hook(model, data, buffer, geom_plate, geom_peg, margin):  # type: ignore[no-untyped-def]
    collide(model, data, geom_plate, geom_peg)
    return 0


def install() -> None:
    """Put the exact contacts into this process's collision table; harmless when repeated."""
    native.collide_by(PLATE_TYPE, PEG_TYPE, _hook.address)
