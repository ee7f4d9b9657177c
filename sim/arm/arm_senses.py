"""Readings of the arm, compiled: joint states with noise and zero errors, and the estimated external wrench.

The law reads the joint states once every control period; a scan reads the states of the newest cycle. The wrench of a scan
includes the least-squares wrench (J Jᵀ)⁻¹ J tau of the unmodelled joint torques tau, at the pose of the newest cycle.
"""

import math

import numpy as np

from drivers import impedance
from drivers.arm.model import JOINTS
from drivers.compiled import njit
from drivers.quantities import Vector
from sim.arm.arm_truth import ArmTruth

NOISES = 2 * JOINTS + 6
"""Number of random numbers in one control cycle: positions, velocities, force and torque."""
ENTRY = 2 * JOINTS + 6
"""Number of words of one cycle's reading: positions, velocities, force and torque."""

IS_IDEAL, NOISE, FORCE_NOISE, TORQUE_NOISE, BLEND = 0, 1, 2, 3, 4
"""Indices of single words: 1 if readings are exact; standard deviations of the noise; low-pass coefficient of the wrench
per cycle, fraction."""
FORCE = 5
"""Index of three words: the force that the arm reports without contact, N."""
ZERO, RATE_NOISE, UNMODELLED, WRENCH = 8, 15, 22, 29
"""Indices of seven words each: errors of the joints' zeros, rad; noise of the velocities, rad/s; error of the modelled
torques, N·m. `WRENCH` is the index of six words: the low-passed wrench.
"""
PLAY, ENCODER = 35, 36
"""Index of half the backlash of the wrist's joints, rad, and of seven words: encoder positions, rad."""
NEWEST = 43
"""Index of the reading of the newest cycle."""
WORDS = NEWEST + ENTRY


def words_of(truth: ArmTruth, period: float) -> Vector:
    """Return the words of the arm's readings before the first cycle, shape (WORDS,); the control period is in s."""
    words = np.zeros(WORDS)
    reading, wrench = truth.reading, truth.wrench
    words[NOISE] = reading.noise
    words[PLAY] = reading.backlash / 2
    words[FORCE_NOISE], words[TORQUE_NOISE] = wrench.force_noise, wrench.torque_noise
    words[BLEND] = 1.0 - math.exp(-2.0 * math.pi * wrench.cutoff * period)
    words[FORCE : FORCE + 3] = wrench.force
    words[ZERO : ZERO + JOINTS] = reading.zero
    words[RATE_NOISE : RATE_NOISE + JOINTS] = reading.rate_noise
    words[UNMODELLED : UNMODELLED + JOINTS] = wrench.joint_torque
    is_told = words[NOISE:BLEND].any() or words[FORCE:WRENCH].any() or reading.backlash > 0.0
    words[IS_IDEAL] = not any(truth.gravity) and not is_told and math.isinf(wrench.cutoff)
    return words


def fill(words: Vector, q: Vector, dq: Vector) -> None:
    """Fill in one reading: joint positions and velocities, shape (7,) each, rad and rad/s; zero wrench."""
    words[ENCODER : ENCODER + JOINTS] = q
    words[NEWEST:] = np.concatenate([q + words[ZERO : ZERO + JOINTS], dq, np.zeros(6)])
    words[WRENCH : WRENCH + 6] = 0.0


@njit(cache=True, inline="always")
def measure(
    words: Vector, q: Vector, dq: Vector, wrench: Vector, noise: Vector
) -> tuple[Vector, Vector]:  # pragma: no cover
    """Read the joints and the wrench once every control period, and store them for the scans.

    Args:
        words: State of the readings; updated.
        q: True joint positions, shape (7,), rad.
        dq: True joint velocities, shape (7,), rad/s.
        wrench: Metered force, N, and torque, N·m, of the plates on the peg, shape (6,).
        noise: Standard normal numbers, shape (NOISES,).

    Returns:
        Positions and velocities that the law reads.
    """
    if words[IS_IDEAL] > 0.0:
        return q, dq
    entry = words[NEWEST : NEWEST + ENTRY]
    for i in range(JOINTS):
        # The encoder e follows its link q with play b to either side: e <- min(max(e, q - b), q + b).
        # First joint of the wrist.
        play = words[PLAY] if i >= 4 else 0.0
        words[ENCODER + i] = min(max(words[ENCODER + i], q[i] - play), q[i] + play)
        entry[i] = words[ENCODER + i] + words[ZERO + i] + words[NOISE] * noise[i]
        entry[JOINTS + i] = dq[i] + words[RATE_NOISE + i] * noise[JOINTS + i]
    for k in range(6):
        sigma = words[FORCE_NOISE] if k < 3 else words[TORQUE_NOISE]
        felt = wrench[k] + sigma * noise[2 * JOINTS + k]
        words[WRENCH + k] += words[BLEND] * (felt - words[WRENCH + k])
        entry[2 * JOINTS + k] = words[WRENCH + k]
    return entry[:JOINTS], entry[JOINTS : 2 * JOINTS]


Reading = tuple[Vector, Vector, Vector, Vector, Vector, Vector, Vector]
"""Reading of the arm in one scan: joint positions, rad, and velocities, rad/s, shape (7,) each; wrench at the TCP, shape
(6,), N and N·m, base frame; position, m, and axes as columns of the TCP, computed from the joint positions read; commanded
and unexplained joint torques of the law, shape (7,) each, N·m."""
COMMANDED = ENTRY + 12
"""Index of the commanded torques among the concatenated fields."""


def scanned(words: Vector, arm: Vector, felt: Vector, law: Vector) -> Reading:
    """Return the reading of a scan; arguments as in `_pack`."""
    packed = np.empty(COMMANDED + 2 * JOINTS)
    _pack(words, arm, felt, law, packed)
    q, dq, wrench = packed[:JOINTS], packed[JOINTS : 2 * JOINTS], packed[2 * JOINTS : ENTRY]
    rotation = packed[ENTRY + 3 : COMMANDED].reshape(3, 3)
    torques = packed[COMMANDED : COMMANDED + JOINTS], packed[COMMANDED + JOINTS :]
    return q, dq, wrench, packed[ENTRY : ENTRY + 3], rotation, *torques


@njit(cache=True)
def _pack(words: Vector, arm: Vector, felt: Vector, law: Vector, packed: Vector) -> None:  # pragma: no cover
    """Write the concatenated fields of `Reading` into `packed`, because compiled code takes a microsecond to return an array.

    Args:
        words: State of the readings.
        arm: Figures of the arm that the cell assumes, see `drivers.impedance.figures`.
        felt: Torques on the joints that the arm's model does not contain, shape (7,), N·m.
        law: State of the torque law.
        packed: The fields; overwritten.
    """
    for i in range(ENTRY):
        packed[i] = words[NEWEST + i]
    q, wrench = packed[:JOINTS], packed[2 * JOINTS : ENTRY]
    position, rotation, axes, origins = impedance.forward(arm, q)
    unexplained(position, axes, origins, words[UNMODELLED : UNMODELLED + JOINTS] + felt, wrench)
    for k in range(3):
        wrench[k] += words[FORCE + k]
    for i in range(3):
        packed[ENTRY + i] = position[i]
        for j in range(3):
            packed[ENTRY + 3 + 3 * i + j] = rotation[i, j]
    for i in range(JOINTS):
        packed[COMMANDED + i] = law[impedance.TORQUE + i]
        packed[COMMANDED + JOINTS + i] = -law[impedance.RESIDUAL + i]


@njit(cache=True, inline="always")
def unexplained(
    position: Vector, axes: Vector, origins: Vector, torque: Vector, wrench: Vector
) -> None:  # pragma: no cover
    """Add the least-squares wrench at the tool centre point for given joint torques.

    Args:
        position: Tool centre point, shape (3,), m, base frame.
        axes: Axes of the joints, shape (7, 3), base frame.
        origins: A point on each of these axes, shape (7, 3), m, base frame.
        torque: Joint torques, shape (7,), N·m.
        wrench: Force, N, and torque, N·m, shape (6,); updated.
    """
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
