"""Margins of gains against the arm's own torque path: torques that act late, behind a low-pass, on rotors that may be light.

The law is taken as linear about a posture at rest: tau = -(Jᵀ K J + N) q - (Jᵀ D J + Nd) dq, every control period, with D as the law works it
out from the inertia that it believes. Torques act some cycles later, held for a cycle, through a first-order low-pass, on the inertia of the links
and the least that the rotors may show. One cycle is then one matrix, and the loop is stable where its eigenvalues lie inside the unit circle.
Friction of the joints, which helps, is left out.

An arm that holds still has another law, -M (r² q + 2 r dq), in which M is the inertia that it counts on. Its modes are those of M against the
true inertia, and each is one loop: with M c times the true inertia at most, along every direction, it is stable where a single joint is with c
times its torques. `largest_hold` says how many times these torques an arm bears, with the most that it may count on and the least that may show.
"""

from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np

from cell.margins import MARGIN, Place
from cell.sampled_loop import exponential, radius
from drivers import impedance
from drivers.arm.inertia import critical_damping, joint_inertia, tip_inertia
from drivers.arm.kinematics import jacobian, links
from drivers.arm.model import JOINTS, ArmModel
from drivers.quantities import Vector
from skills.motion import Gains

GROWTH = 1.02
"""Ratio of neighbouring factors in the search for the limit."""
MOST = 20.0
"""Factor beyond which torques are taken for unlimited."""
SINGULAR = 1e-4
"""Addition to J Jᵀ with which the law projects its null space."""


@lru_cache(maxsize=64)
def is_steady(gains: Gains, place: Place, factor: float = MARGIN) -> bool:
    """Return whether the arm stays at rest with `factor` times the torques of these gains, peg tilted and upright."""
    return _holds(_cycles(gains, place), factor)


@lru_cache(maxsize=64)
def largest(gains: Gains, place: Place) -> float:
    """Return the factor by which all torques of these gains can be multiplied before the arm swings; `MOST` when there is none."""
    return _largest(_cycles(gains, place))


@lru_cache(maxsize=64)
def is_hold_steady(place: Place, factor: float = MARGIN) -> bool:
    """Return whether an arm that holds still stays at rest with `factor` times its torques, peg tilted and upright."""
    return _holds(_hold_cycles(place), factor)


@lru_cache(maxsize=64)
def largest_hold(place: Place) -> float:
    """Return the factor by which the torques of an arm that holds still can be multiplied before it swings; `MOST` when there is none."""
    return _largest(_hold_cycles(place))


def _hold_cycles(place: Place) -> list[tuple[Vector, Vector]]:
    cycles = []
    for q in place.postures():
        idle, once = (one_held_cycle(place.arm, q, factor) for factor in (0.0, 1.0))
        cycles.append((idle, once - idle))
    return cycles


def _cycles(gains: Gains, place: Place) -> list[tuple[Vector, Vector]]:
    """Return, for each posture, one cycle without torques, and what one time the torques of these gains adds to it."""
    cycles = []
    for q in place.postures():
        idle, once = (one_cycle(place.arm, q, place.length, gains, factor) for factor in (0.0, 1.0))
        cycles.append((idle, once - idle))
    return cycles


def _largest(cycles: Sequence[tuple[Vector, Vector]]) -> float:
    factor = 1.0 / MOST
    while factor < MOST and _holds(cycles, factor * GROWTH):
        factor *= GROWTH
    return factor


def _holds(cycles: Iterable[tuple[Vector, Vector]], factor: float) -> bool:
    return all(radius(idle + factor * added) < 1.0 for idle, added in cycles)


def one_cycle(arm: ArmModel, q: Vector, length: float, gains: Gains, factor: float) -> Vector:
    """Return the matrix that takes joints, velocities, acting torques and torques on their way from one control cycle to the next.

    Args:
        arm: The arm, with its torque path.
        q: Joint positions, shape (7,), rad.
        length: Distance from the finger centre to the controlled point, m.
        gains: Stiffness and damping ratio.
        factor: Multiple of the torques that the law commands.

    Returns:
        Matrix of shape (7 (3 + delay), 7 (3 + delay)), the delay in cycles, at least 1.
    """
    return _one_cycle(arm, q, factor * _law(arm, q, length, gains))


def one_held_cycle(arm: ArmModel, q: Vector, factor: float) -> Vector:
    """Return the same matrix for an arm that holds still and counts on the most inertia that it may; see `one_cycle`."""
    counted = joint_inertia(arm, q) + np.diag(np.array(arm.joints.rotor_inertia) + impedance.most_learnt(arm))
    rate = impedance.HOLD_RATE
    return _one_cycle(arm, q, factor * np.hstack([rate**2 * counted, 2.0 * rate * counted]))


def _one_cycle(arm: ArmModel, q: Vector, law: Vector) -> Vector:
    """Return the matrix of one control cycle with a law of shape (7, 14), which positions and velocities take away from the torques."""
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


def _law(arm: ArmModel, q: Vector, length: float, gains: Gains) -> Vector:
    """Return the torques that one unit of position, then of velocity, of each joint takes away, shape (7, 14)."""
    rotations, origins = links(arm, q)
    axes = np.array([rotation[:, 2] for rotation in rotations])
    J = jacobian(origins[-1] + (arm.kinematics.flange + arm.hand.finger_centre + length) * axes[-1], axes, origins)
    stiffness = gains.stiffness()
    D = gains.damping_ratio * critical_damping(tip_inertia(arm, q, length), stiffness)
    null = np.eye(JOINTS) - J.T @ np.linalg.inv(J @ J.T + SINGULAR * np.eye(6)) @ J
    return np.hstack(
        [
            J.T @ np.diag(stiffness) @ J + impedance.NULL_STIFFNESS * null,
            J.T @ D @ J + impedance.NULL_DAMPING * null,
        ]
    )
