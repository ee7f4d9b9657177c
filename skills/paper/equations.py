"""Equations of [gibbons] that a skill computes, in the paper's symbols; pure.

The other equations are elsewhere:

- Eq. (1), the image I of both fingers: `skills.tactile.picture`.
- Eq. (2) and (3), T_f_p, v and x_p: `drivers.frames`. The printed Eq. (2) is not a rigid transform; it is corrected there.
- Eq. (5) and (6), e and tau: the arm's law `drivers.impedance`, with x_p*, v* and K from the setpoint. The printed
  Eq. (5) with -K e turns the peg away from v*. The law therefore uses the orientation error (v* x v)·phi / |v* x v|.
"""

import math

import numpy as np

from drivers.frames import angle_between, rotation_about
from drivers.quantities import Vector

OFFSET = 0.01
"""Depth of the end point's setpoint below the surface, m; the adjustment measures it from the end point.

Source: [gibbons], Sec. IV and V.A.
"""
MOST_LEAD = 0.9
"""Largest angle between the peg and its setpoint, rad; the setpoint gate refuses 1. Source: chosen, not measured."""


def x_star(x_h: Vector, surface: float) -> Vector:
    """Return the setpoint x_p* of the end point, shape (3,), m, base frame: Eq. (4).

    Args:
        x_h: Position of the hole, shape (3,), m, base frame.
        surface: Height of the plate, m, base frame.
    """
    # Eq. (4): x_p* = [x_h,x  x_h,y  x*_p,z]^T, x*_p,z an offset below the surface
    return np.array([x_h[0], x_h[1], surface - OFFSET])


def k_33(phi: float, phi_0: float, k_min: float, k_max: float) -> float:
    """Return the stiffness along z, N/m: Eq. (7), at least K_min.

    Args:
        phi: Angle between v and v*, rad, >= 0.
        phi_0: The same angle upon contact, rad.
        k_min: K_min, N/m.
        k_max: K_max, N/m.
    """
    # Eq. (7): [K]_33 = K_max exp(-a phi), a = -ln(K_min / K_max) / phi_0
    return k_max * math.exp(math.log(k_min / k_max) * min(phi / max(phi_0, 1e-3), 1.0))


def towards(v: Vector, v_star: Vector) -> Vector:
    """Return v*, limited to the angle `MOST_LEAD` from v: a unit vector, shape (3,)."""
    if angle_between(v, v_star) <= MOST_LEAD:
        return v_star
    # Rotation of v by MOST_LEAD about n = v x v* / |v x v*|
    n = np.cross(v, v_star)
    lead: Vector = rotation_about(n / np.linalg.norm(n), MOST_LEAD) @ v
    return lead
