"""Shear and friction of the pads on a held peg in their plane, compiled.

The held peg has three degrees of freedom in the hand: it rotates about the closing axis at the finger centre, and moves
along and beside its own axis. The pads' shear pulls it back to its sticking point. The force f through the centre of
the contact and the moment m about it stay inside the ellipsoid (|f| / F)² + (m / M)² = 1. It is the usual approximation
of the limit surface of friction [howe]. If a load would leave the ellipsoid, the peg slips and its sticking point
follows. Shear and damping are explicit: torque and forces computed at the beginning of a step.
"""

import math

from drivers.compiled import njit
from drivers.quantities import Vector
from sim.hand.pads import GripLimits

MASS = 0.08
"""Mass that moves with the peg in the pads' plane, kg: rubber and finger tips, without the peg. Assumed; with it, steps
of 1 ms resolve the shear under the lightest peg, and the arm adds thirty times this mass behind the peg."""
TURNING_INERTIA = MASS * 0.035**2 / 12
"""Inertia of the same mass about the closing axis, over a contact of 35 mm, kg·m²."""

LOSS = 0.4
"""Damping ratio of the peg on the pads' shear, ratio to critical; assumed: a soft rubber under a peg with friction."""

FORCE, TORQUE, ALONG, BESIDE = 0, 1, 2, 3
"""Largest force, N, and moment, N·m; centre of the contact along the peg, z from its tip to the finger, and beside it,
m."""
STIFFNESS, TURNING, DAMPING, TURN_DAMPING = 4, 5, 6, 7
"""Stiffness of the shear along the pads, N/m, and about the closing axis, N·m/rad; its damping, N·s/m and N·m·s/rad."""
STUCK, APPLIED = 8, 11
"""Three words each: rotation, position along and position beside at which the peg sticks, rad and m; forces of the last
step, N·m and N."""
START = 14
"""Two words: position along and beside at the grasp, m."""
SLIP = 16
"""Largest slip of the peg from the grasp position, m."""
WORDS = 17


def grasp(words: Vector, turn: float, along: float, beside: float) -> None:
    """Set the sticking point to the present one: rotation, rad, and position along and beside the peg's axis, m."""
    words[:] = 0.0
    words[STUCK : STUCK + 3] = turn, along, beside
    words[START : START + 2] = along, beside


def bear(words: Vector, limits: GripLimits, beside: float, shear: float, carried: tuple[float, float]) -> None:
    """Set the present friction limits and shear stiffness of the pads.

    Args:
        words: The grip; updated.
        limits: Limits of friction.
        beside: Position of the peg's axis beside the finger centre, m.
        shear: Stiffness of both pads in their plane, N/m.
        carried: Mass of the peg, kg, and its inertia about the closing axis at the finger centre, kg·m².
    """
    # Uniform shear over the contact length l: k_r = k l² / 12.
    turning = shear * (limits.length * limits.length) / 12
    words[FORCE : BESIDE + 1] = limits.force, limits.torque, -limits.middle, beside
    # Damping c = 2 zeta sqrt(k m), for the rotation with k_r and the inertia.
    damping = 2.0 * LOSS * math.sqrt(shear * (MASS + carried[0]))
    turn_damping = 2.0 * LOSS * math.sqrt(turning * (TURNING_INERTIA + carried[1]))
    words[STIFFNESS : TURN_DAMPING + 1] = shear, turning, damping, turn_damping


@njit(cache=True, inline="always")
def act(words: Vector, qpos: Vector, qvel: Vector, qfrc: Vector, first: int) -> None:  # pragma: no cover
    """Add the pads' forces on the peg in the coming step to the applied forces.

    Args:
        words: The grip; updated.
        qpos: Positions; rotation, position along and position beside start at `first`.
        qvel: Velocities.
        qfrc: Applied generalised forces; other contributions stay.
        first: Index of the rotation.
    """
    along, beside = words[ALONG], words[BESIDE]
    # At the centre of the contact, a rotation w moves the peg by (-w·along) beside its axis and by (w·beside) along it.
    turn = qpos[first] - words[STUCK]
    z = qpos[first + 1] - words[STUCK + 1] + turn * beside
    y = qpos[first + 2] - words[STUCK + 2] - turn * along
    k, turning = words[STIFFNESS], words[TURNING]
    # e = sqrt((k |d| / F)² + (k_r w / M)²). If e > 1, the shear shrinks to d / e and the sticking point follows.
    excess = _share(words, k * z, k * y, turning * turn)
    if excess > 1.0:
        turn, z, y = turn / excess, z / excess, y / excess
        words[STUCK] = qpos[first] - turn
        words[STUCK + 1] = qpos[first + 1] - z + turn * beside
        words[STUCK + 2] = qpos[first + 2] - y - turn * along
        slip = math.hypot(words[STUCK + 1] - words[START], words[STUCK + 2] - words[START + 1])
        words[SLIP] = max(words[SLIP], slip)
    rate = qvel[first]
    # Forces f = -k d - c d' and moment m = -k_r w - c_r w', scaled back to the ellipsoid.
    force_z = -k * z - words[DAMPING] * (qvel[first + 1] + rate * beside)
    force_y = -k * y - words[DAMPING] * (qvel[first + 2] - rate * along)
    moment = -turning * turn - words[TURN_DAMPING] * rate
    excess = max(_share(words, force_z, force_y, moment), 1.0)
    force_z, force_y, moment = force_z / excess, force_y / excess, moment / excess
    applied = (moment + beside * force_z - along * force_y, force_z, force_y)
    for i in range(3):
        qfrc[first + i] += applied[i] - words[APPLIED + i]
        words[APPLIED + i] = applied[i]


@njit(cache=True)
def _share(words: Vector, force_z: float, force_y: float, moment: float) -> float:  # pragma: no cover
    """Return the size of a load relative to the limit surface: 1 on it, very large if friction is zero."""
    # sqrt((|f| / F)² + (m / M)²).
    most, turning = max(words[FORCE], 1e-9), max(words[TORQUE], 1e-12)
    return math.sqrt((force_z * force_z + force_y * force_y) / (most * most) + moment * moment / (turning * turning))
