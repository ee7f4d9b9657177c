"""Compiled kinetic energy of the arm's deviation from the planned motion, evaluated by `skills.guards.passivity` at every scan.

The module is separate so that the register map, which needs only the names of the skills, does not import the compiler.
"""

import math

import numpy as np

from drivers.compiled import njit
from drivers.quantities import Vector

WRIST = 0.15
"""Distance behind the finger centre at which the arm's translational and rotational inertia decouple, m. Source: chosen, not measured."""
MASS = 5.0
"""Mass of the arm at the decoupling point, kg; 4 to 9 kg in the simulated arm over poses and directions, with a hand that
can turn freely and with one that cannot. Source: measured on the simulated arm.
"""
INERTIA = 0.03
"""Inertia of the arm about the decoupling point, kg·m²; 0.007 to 0.08 kg·m² in the simulated arm over poses and directions. Source: measured on the simulated arm."""
LEVER = 0.1
"""Lever arm by which the force limit is multiplied to give the torque limit of the rotational spring, m. Source: chosen, not measured."""


@njit(cache=True)
def energy(
    stiffness: Vector,
    linear: Vector,
    angular: Vector,
    theta: float,
    length: float,
    p: Vector,
    A: Vector,
    q: Vector,
    D: Vector,
    period: float,
    force_limit: float,
) -> float:  # pragma: no cover
    """Return the kinetic energy of the arm's deviation from the planned motion, fraction of the energy at the force limit.

    Args:
        stiffness: Stiffness of the setpoint held between the two samples, shape (6,).
        linear: Planned velocity of the controlled point, shape (3,), m/s, base frame.
        angular: Planned angular velocity, shape (3,), rad/s, base frame.
        theta: In-hand angle of the controlled point, rad.
        length: Distance from the finger centre to the controlled point, m.
        p: Position of the finger centre at the first sample, shape (3,), m, base frame.
        A: Axes of the finger frame at the first sample, shape (3, 3), base frame.
        q: Position of the finger centre at the second sample, shape (3,), m, base frame.
        D: Axes of the finger frame at the second sample, shape (3, 3), base frame.
        period: Time between the samples, s.
        force_limit: Largest external force at the TCP, N.
    """
    lever, v, w = np.empty(3), np.empty(3), np.empty(3)
    for k in range(3):
        # Lever l from the controlled point to the wrist, and velocity v of the wrist.
        lever[k] = -WRIST * D[k, 0] - length * (math.cos(theta) * D[k, 0] + math.sin(theta) * D[k, 1])
        v[k] = (q[k] - WRIST * D[k, 0] - p[k] + WRIST * A[k, 0]) / period
        # R = D Aᵀ; omega = [R32 - R23, R13 - R31, R21 - R12] / (2 period), for small angles
        i, j = (k + 1) % 3, (k + 2) % 3
        w[k] = 0.0
        for n in range(3):
            w[k] += (D[j, n] * A[i, n] - D[i, n] * A[j, n]) / (2.0 * period)
    pushing = turning = 0.0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        # Deviation from the plan: v - (v_tip + omega_plan x l), omega - omega_plan
        off = v[k] - linear[k] - angular[i] * lever[j] + angular[j] * lever[i]
        pushing += stiffness[k] * off * off
        turning += stiffness[3 + k] * (w[k] - angular[k]) ** 2
    # m v²/2 over F²/(2 K), summed over the axes, and I omega²/2 over (LEVER F)²/(2 K_r)
    return MASS * pushing / force_limit**2 + INERTIA * turning / (LEVER * force_limit) ** 2
