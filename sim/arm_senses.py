"""The readings of the arm, compiled: joints with noise and wrong zeros, and the external wrench as the arm estimates it.

The law reads the newest joints once every control period; a scan reads those of some cycles ago, which are kept in a ring
together with the wrench. What unmodelled joint torques add to the wrench is computed when it is read: the least-squares
wrench (J Jᵀ)⁻¹ J of those torques at the pose of that cycle.
"""

import math

import numpy as np

from drivers import impedance
from drivers.arm.model import JOINTS
from drivers.compiled import njit
from drivers.quantities import Vector
from sim.arm_truth import LONGEST_DELAY, ArmTruth

NOISES = 2 * JOINTS + 6
"""Number of random numbers that a control cycle takes: positions, velocities, force and torque."""
ENTRY = 2 * JOINTS + 6
"""Number of words that one cycle's reading takes: positions, velocities, force and torque."""

IS_IDEAL, DELAY, AT, NOISE, FORCE_NOISE, TORQUE_NOISE, BLEND = 0, 1, 2, 3, 4, 5, 6
"""Indices of single words: whether all is read as it is; age of what a scan reads, control cycles; place of the newest
cycle in the ring; standard deviations of noise; share of the way to its goal that the wrench's low-pass covers in a
cycle.
"""
FORCE_DEAD, TORQUE_DEAD, FORCE = 7, 8, 9
"""Indices of three words each: dead zones, N and N·m, and the force that is reported where nothing touches, N."""
ZERO, RATE_NOISE, UNMODELLED, WRENCH = 12, 19, 26, 33
"""Indices of seven words each: errors of the joints' zeros, rad; noise of the velocities, rad/s; error of the modelled
torques, N·m; then six words of the low-passed wrench.
"""
PLAY, ENCODER = 39, 40
"""Index of half the backlash of the wrist's joints, rad, and of seven words: positions of the encoders, rad."""
WRIST = 4
"""First joint of the wrist."""
RING = 47
WORDS = RING + ENTRY * (LONGEST_DELAY + 1)


def words_of(truth: ArmTruth, period: float) -> Vector:
    """Return the words of the arm's senses before the first cycle, shape (WORDS,); the control period is in s."""
    words = np.zeros(WORDS)
    reading, wrench = truth.reading, truth.wrench
    words[DELAY] = reading.delay
    words[NOISE] = reading.noise
    words[PLAY] = reading.backlash / 2
    words[FORCE_NOISE], words[TORQUE_NOISE] = wrench.force_noise, wrench.torque_noise
    words[BLEND] = 1.0 - math.exp(-2.0 * math.pi * wrench.cutoff * period)
    words[FORCE_DEAD], words[TORQUE_DEAD] = wrench.force_dead_zone, wrench.torque_dead_zone
    words[FORCE : FORCE + 3] = wrench.force
    words[ZERO : ZERO + JOINTS] = reading.zero
    words[RATE_NOISE : RATE_NOISE + JOINTS] = reading.rate_noise
    words[UNMODELLED : UNMODELLED + JOINTS] = wrench.joint_torque
    is_felt = any(truth.gravity) or truth.payload.mass > 0.0
    is_told = words[DELAY] > 0.0 or words[NOISE:BLEND].any() or words[FORCE_DEAD:WRENCH].any() or reading.backlash > 0.0
    words[IS_IDEAL] = not is_felt and not is_told and math.isinf(wrench.cutoff)
    return words


def fill(words: Vector, q: Vector, dq: Vector) -> None:
    """Fill the ring as if every cycle so far had read these joints, shape (7,) each, rad and rad/s, and no wrench."""
    words[ENCODER : ENCODER + JOINTS] = q
    entry = np.concatenate([q + words[ZERO : ZERO + JOINTS], dq, np.zeros(6)])
    words[RING:] = np.tile(entry, LONGEST_DELAY + 1)
    words[WRENCH : WRENCH + 6] = 0.0


@njit(cache=True)
def measure(
    words: Vector, q: Vector, dq: Vector, wrench: Vector, noise: Vector
) -> tuple[Vector, Vector]:  # pragma: no cover
    """Read the joints and the wrench, once every control period, and keep them for the scans.

    Args:
        words: The senses; updated.
        q: True joint positions, shape (7,), rad.
        dq: True joint velocities, shape (7,), rad/s.
        wrench: Force, N, and torque, N·m, of the plates on the peg as metered, shape (6,).
        noise: Standard normal numbers, shape (NOISES,).

    Returns:
        Positions and velocities as the law reads them.
    """
    if words[IS_IDEAL] > 0.0:
        return q, dq
    at = (int(words[AT]) + 1) % (LONGEST_DELAY + 1)
    words[AT] = at
    entry = words[RING + ENTRY * at : RING + ENTRY * (at + 1)]
    for i in range(JOINTS):
        # An encoder with play b to either side follows its link when pushed: e <- min(max(e, q - b), q + b).
        play = words[PLAY] if i >= WRIST else 0.0
        words[ENCODER + i] = min(max(words[ENCODER + i], q[i] - play), q[i] + play)
        entry[i] = words[ENCODER + i] + words[ZERO + i] + words[NOISE] * noise[i]
        entry[JOINTS + i] = dq[i] + words[RATE_NOISE + i] * noise[JOINTS + i]
    for k in range(6):
        sigma = words[FORCE_NOISE] if k < 3 else words[TORQUE_NOISE]
        felt = wrench[k] + sigma * noise[2 * JOINTS + k]
        words[WRENCH + k] += words[BLEND] * (felt - words[WRENCH + k])
        entry[2 * JOINTS + k] = words[WRENCH + k]
    return entry[:JOINTS], entry[JOINTS : 2 * JOINTS]


@njit(cache=True)
def scanned(words: Vector, arm: Vector, felt: Vector) -> tuple[Vector, Vector, Vector]:  # pragma: no cover
    """Return what a scan reads now: joint positions, rad, velocities, rad/s, and the wrench, N and N·m, shape (6,).

    Args:
        words: The senses.
        arm: Figures of the arm as the cell believes them, see `drivers.impedance.figures`.
        felt: Torques on the joints that the arm's model does not know and that move it, shape (7,), N·m.
    """
    at = (int(words[AT]) - int(words[DELAY])) % (LONGEST_DELAY + 1)
    entry = words[RING + ENTRY * at : RING + ENTRY * (at + 1)].copy()
    q, dq, wrench = entry[:JOINTS], entry[JOINTS : 2 * JOINTS], entry[2 * JOINTS :]
    unexplained(arm, q, words[UNMODELLED : UNMODELLED + JOINTS] + felt, wrench)
    for k in range(6):
        wrench[k] += words[FORCE + k] if k < 3 else 0.0
        dead = words[FORCE_DEAD] if k < 3 else words[TORQUE_DEAD]
        wrench[k] = math.copysign(max(abs(wrench[k]) - dead, 0.0), wrench[k])
    return q, dq, wrench


@njit(cache=True)
def unexplained(arm: Vector, q: Vector, torque: Vector, wrench: Vector) -> None:  # pragma: no cover
    """Add the wrench at the tool centre point that explains joint torques best, in the least-squares sense.

    Args:
        arm: Figures of the arm, see `drivers.impedance.figures`.
        q: Joint positions, shape (7,), rad.
        torque: Joint torques, shape (7,), N·m.
        wrench: Force, N, and torque, N·m, shape (6,); updated.
    """
    position, _, axes, origins = impedance.forward(arm, q)
    J = np.empty((6, JOINTS))
    for i in range(JOINTS):
        rx, ry, rz = position[0] - origins[i, 0], position[1] - origins[i, 1], position[2] - origins[i, 2]
        ax, ay, az = axes[i, 0], axes[i, 1], axes[i, 2]
        J[0, i], J[1, i], J[2, i] = ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx
        J[3, i], J[4, i], J[5, i] = ax, ay, az
    A, b = np.empty((6, 6)), np.zeros(6)
    for k in range(6):
        for j in range(6):
            A[k, j] = 0.0
            for i in range(JOINTS):
                A[k, j] += J[k, i] * J[j, i]
        A[k, k] += 1e-9
        for i in range(JOINTS):
            b[k] += J[k, i] * torque[i]
    impedance.solve(A, b)
    for k in range(6):
        wrench[k] += b[k]
