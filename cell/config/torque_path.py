"""Stability margins of gains with the arm's own torque path: delay, low-pass, and uncertain rotor inertia.

The law is linearized about a posture at rest: tau = -(Jᵀ K J + N) q - (Jᵀ D J + Nd) dq, every control period. The law
computes D from its modelled inertia. Torques act some cycles later, held for a cycle, through a first-order low-pass. They
act on the inertia of the links plus the least rotor inertia. One cycle is then one matrix, and the loop is stable if its
eigenvalues are inside the unit circle. Joint friction, which stabilizes, is left out.

A holding arm has another law, -M (r² q + 2 r dq), in which M is its modelled inertia. Its modes are those of M relative
to the true inertia, and each mode is one loop. With M at most c times the true inertia in every direction, the arm is
stable if a single joint is stable with c times its torques. The factor c is computed for the largest modelled and the
least true inertia.
"""

from collections.abc import Iterable
from functools import lru_cache

import numpy as np

from cell.config.margins import MARGIN, Place
from cell.config.sampled_loop import exponential, first_unstable, radius
from drivers import impedance
from drivers.arm.inertia import critical_damping, joint_inertia, tip_inertia
from drivers.arm.kinematics import tip_jacobian
from drivers.arm.model import JOINTS, ArmModel
from drivers.quantities import Vector
from skills.motion import Gains

MOST = 20.0
"""Factor above which torques count as unlimited."""


@lru_cache(maxsize=64)
def is_steady(gains: Gains | None, place: Place) -> bool:
    """Return True if the loop is stable with `MARGIN` times its torques, peg tilted and upright; `gains` None means a holding arm's loop."""
    return _holds(_cycles(gains, place), MARGIN)


@lru_cache(maxsize=64)
def largest(gains: Gains | None, place: Place) -> float:
    """Return the factor on all torques at which the loop becomes unstable, at most `MOST`; `gains` None means a holding arm's loop."""
    cycles = _cycles(gains, place)
    return first_unstable(lambda factor: _holds(cycles, factor), MOST)


def _cycles(gains: Gains | None, place: Place) -> list[tuple[Vector, Vector]]:
    """Return, for each posture, the matrix of one cycle without torques, and the matrix that the torques add."""
    idle, whole = (
        [one_cycle(place.arm, q, place.length, gains, factor) for q in place.postures()] for factor in (0.0, 1.0)
    )
    return [(without, acting - without) for without, acting in zip(idle, whole, strict=True)]


def _holds(cycles: Iterable[tuple[Vector, Vector]], factor: float) -> bool:
    return all(radius(idle + factor * added) < 1.0 for idle, added in cycles)


def one_cycle(arm: ArmModel, q: Vector, length: float, gains: Gains | None, factor: float) -> Vector:
    """Return the transition matrix of positions, velocities, acting torques and delayed torques over one control cycle.

    Args:
        arm: The arm, with its torque path.
        q: Joint positions, shape (7,), rad.
        length: Distance from the finger centre to the controlled point, m.
        gains: Stiffness and damping ratio; None for a holding arm with the largest modelled inertia.
        factor: Factor on the commanded torques.

    Returns:
        Matrix of shape (7 (3 + delay), 7 (3 + delay)), the delay in cycles, at least 1.
    """
    law = factor * (_hold_law(arm, q) if gains is None else _law(arm, q, length, gains))
    n, path = JOINTS, arm.torque_path
    delay = max(round(path.transport / arm.control_period), 1)
    rotors = path.rotor_share * np.diag(arm.joints.rotor_inertia)
    corner = 2.0 * np.pi * path.cutoff
    # Positions, velocities, acting torques, and the torque that arrives in this cycle.
    flow = np.zeros((4 * n, 4 * n))
    flow[:n, n : 2 * n] = np.eye(n)
    flow[n : 2 * n, 2 * n : 3 * n] = np.linalg.inv(joint_inertia(arm, q) + rotors)
    flow[2 * n : 3 * n, 2 * n : 3 * n], flow[2 * n : 3 * n, 3 * n :] = -corner * np.eye(n), corner * np.eye(n)
    passed = exponential(flow * arm.control_period)
    step = np.zeros(((3 + delay) * n,) * 2)
    step[: 3 * n, : 3 * n] = passed[: 3 * n, : 3 * n]
    step[: 3 * n, -n:] += passed[: 3 * n, 3 * n :]
    step[3 * n : 4 * n, : 2 * n] = -law
    for k in range(1, delay):
        step[(3 + k) * n : (4 + k) * n, (2 + k) * n : (3 + k) * n] = np.eye(n)
    return step


def _hold_law(arm: ArmModel, q: Vector) -> Vector:
    """Return L of the law tau = -L (q, dq) of a holding arm, shape (7, 14)."""
    counted = joint_inertia(arm, q) + np.diag(np.array(arm.joints.rotor_inertia) + impedance.most_learnt(arm))
    rate = impedance.HOLD_RATE
    return np.hstack([rate**2 * counted, 2.0 * rate * counted])


def _law(arm: ArmModel, q: Vector, length: float, gains: Gains) -> Vector:
    """Return L of the law tau = -L (q, dq), shape (7, 14)."""
    J = tip_jacobian(arm, q, length)
    stiffness = gains.stiffness()
    D = gains.damping_ratio * critical_damping(tip_inertia(arm, q, length), stiffness)
    # Term added to J Jᵀ in the null-space projection of the law.
    null = np.eye(JOINTS) - J.T @ np.linalg.inv(J @ J.T + 1e-4 * np.eye(6)) @ J
    return np.hstack(
        [J.T @ np.diag(stiffness) @ J + impedance.NULL_STIFFNESS * null, J.T @ D @ J + impedance.NULL_DAMPING * null]
    )
