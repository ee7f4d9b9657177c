"""What the pads do to a held peg in their plane, compiled: they give way by their shear, and let it slip beyond friction.

The held peg has three degrees of freedom in the hand: it turns about the closing axis at the finger centre, and moves along
and beside its own axis. The pads' shear draws it back to where it sticks. The force f through the middle of the contact and the
moment m about it stay inside the ellipsoid (|f| / F)² + (m / M)² = 1, the usual approximation of the limit surface of
friction [howe]; what would leave it slips, the place where the peg sticks following. Shear and damping are applied explicitly,
as torque and forces at the beginning of a step.
"""

import math

import numpy as np

from drivers.compiled import njit
from drivers.quantities import Vector
from sim.pads import GripLimits

MASS = 0.08
"""What moves with the peg in the pads' plane beside itself, kg: rubber and finger tips. Assumed; with it the shear under the
lightest peg is followed in steps of 1 ms, and the arm puts thirty times as much behind the peg."""
TURNING_INERTIA = MASS * 0.035**2 / 12
"""The same for the turn about the closing axis, over a contact of 35 mm, kg·m²."""

LOSS = 0.4
"""Damping of the peg on the pads' shear, ratio to the critical; assumed: a soft rubber under a peg that also rubs."""

FORCE, TORQUE, ALONG, BESIDE = 0, 1, 2, 3
"""Largest force, N, and moment, N·m; middle of the contact along the peg, z from its tip to the finger, and beside it, m."""
STIFFNESS, TURNING, DAMPING, TURN_DAMPING = 4, 5, 6, 7
"""Stiffness of the shear along the pads, N/m, and about the closing axis, N·m/rad; its damping, N·s/m and N·m·s/rad."""
STUCK, APPLIED = 8, 11
"""Three each: turn, place along and place beside at which the peg sticks, rad and m; forces of the last step, N·m and N."""
START = 14
"""Two: place along and beside at which it was grasped, m."""
SLIP = 16
"""Largest distance that the peg has slipped from there, m."""
WORDS = 17


def new_words() -> Vector:
    """Return the words of a grip that holds nothing, shape (WORDS,)."""
    return np.zeros(WORDS)


def grasp(words: Vector, turn: float, along: float, beside: float) -> None:
    """Let the peg stick where it is: turn, rad, and place along and beside its axis, m."""
    words[:] = 0.0
    words[STUCK : STUCK + 3] = turn, along, beside
    words[START : START + 2] = along, beside


def bear(words: Vector, limits: GripLimits, beside: float, shear: float, carried: tuple[float, float]) -> None:
    """Set what the pads bear now.

    Args:
        words: The grip; updated.
        limits: Limits of friction.
        beside: Place of the peg's axis beside the finger centre, m.
        shear: Stiffness of both pads in their plane, N/m.
        carried: Mass of the peg, kg, and its inertia about the closing axis at the finger centre, kg·m².
    """
    turning = shear * limits.length**2 / 12
    words[FORCE : BESIDE + 1] = limits.force, limits.torque, -limits.middle, beside
    damping = 2.0 * LOSS * math.sqrt(shear * (MASS + carried[0]))
    turn_damping = 2.0 * LOSS * math.sqrt(turning * (TURNING_INERTIA + carried[1]))
    words[STIFFNESS : TURN_DAMPING + 1] = shear, turning, damping, turn_damping


@njit(cache=True, inline="always")
def act(words: Vector, qpos: Vector, qvel: Vector, qfrc: Vector, first: int) -> None:  # pragma: no cover
    """Write what the pads do to the peg in the step that begins now into the applied forces.

    Args:
        words: The grip; updated.
        qpos: Positions; turn, place along and place beside follow each other from `first` on.
        qvel: Velocities.
        qfrc: Applied generalised forces; what others have put there stays.
        first: Index of the turn.
    """
    along, beside = words[ALONG], words[BESIDE]
    # At the middle of the contact a turn w moves the peg by (-w·along) beside its axis and by (w·beside) along it.
    turn = qpos[first] - words[STUCK]
    z = qpos[first + 1] - words[STUCK + 1] + turn * beside
    y = qpos[first + 2] - words[STUCK + 2] - turn * along
    k, turning = words[STIFFNESS], words[TURNING]
    excess = _share(words, k * z, k * y, turning * turn)
    if excess > 1.0:
        turn, z, y = turn / excess, z / excess, y / excess
        words[STUCK] = qpos[first] - turn
        words[STUCK + 1] = qpos[first + 1] - z + turn * beside
        words[STUCK + 2] = qpos[first + 2] - y - turn * along
        slip = math.hypot(words[STUCK + 1] - words[START], words[STUCK + 2] - words[START + 1])
        words[SLIP] = max(words[SLIP], slip)
    rate = qvel[first]
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
    """Return how far out in the limit surface a load is: 1 on it; far outside where nothing is borne."""
    most, turning = max(words[FORCE], 1e-9), max(words[TORQUE], 1e-12)
    return math.sqrt((force_z * force_z + force_y * force_y) / (most * most) + moment * moment / (turning * turning))
