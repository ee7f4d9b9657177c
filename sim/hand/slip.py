"""Shear and friction of the pads on a held peg, in the plane of the pads; compiled.

The held peg has three degrees of freedom in the hand: it rotates about the closing axis at the finger centre, and moves
along its own axis and across it ("beside"). The pads' shear pulls it back to its sticking point, where the shear is 0.
The force f through the centre of the contact and the moment m about it stay inside the ellipsoid (|f| / F)² + (m / M)²
= 1, the usual approximation of the limit surface of friction [howe]. If a load would leave the ellipsoid, the peg slips
and its sticking point follows. Moment and forces are computed explicitly, from the state at the beginning of a step.
"""

import math

from drivers.compiled import njit
from drivers.quantities import Vector
from sim.hand.grip_limits import grip_limits

MASS = 0.08
"""Mass of rubber and finger tips that moves with the peg in the pads' plane, kg, without the peg. Assumed: it is large
enough for steps of 1 ms under the lightest peg, and small beside the arm's mass behind the peg, thirty times as large."""
TURNING_INERTIA = MASS * 0.035**2 / 12
"""Inertia of the same mass about the closing axis, over a contact of 35 mm, kg·m²."""


FORCE, TORQUE, ALONG, BESIDE = 0, 1, 2, 3
"""Largest force, N, and moment, N·m, of the friction; position of the contact's centre along the peg, positive towards the
finger, and beside the peg, m."""
STIFFNESS, TURNING, DAMPING, TURN_DAMPING = 4, 5, 6, 7
"""Stiffness of the shear along the pads, N/m, and about the closing axis, N·m/rad; its damping, N·s/m and N·m·s/rad."""
STUCK, APPLIED = 8, 11
"""Three words each: rotation, rad, and positions along and beside, m, of the sticking point; moment, N·m, and forces, N, applied last."""
START = 14
"""Two words: position along and beside at the grasp, m."""
SLIP, CONTACT = 16, 17
"""Largest slip of the peg from the grasp position, m; length of the contact along the peg, m."""
PADS = 18
"""Four words: half the length and half the width of a pad, m; Coulomb coefficient of peg on pad; stiffness of both pads in
their plane, N/m."""
PEG = 22
"""Five words: length of the peg from the finger centre to its tip at the grasp, and whole length, m; width of its flat
faces, m, 0 if it is round; its mass, kg, and inertia about the closing axis at the finger centre, kg·m²."""
WORDS = 27


def grasp(
    words: Vector,
    place: tuple[float, float, float],
    pads: tuple[float, float, float, float],
    peg: tuple[float, float, float, float, float],
) -> None:
    """Begin a grasp with the sticking point at `place`: rotation, rad, and position along and beside the peg's axis, m.

    `pads` and `peg` are the words of `PADS` and `PEG`.
    """
    words[:] = 0.0
    words[STUCK : STUCK + 3] = place
    words[START : START + 2] = place[1:]
    words[PADS:PEG], words[PEG:] = pads, peg


@njit(cache=True)
def bear(words: Vector, qpos: Vector, first: int, grip_force: float) -> None:  # pragma: no cover
    """Set the friction limits and the shear of the pads for the peg's present place.

    Args:
        words: The grip; updated.
        qpos: Positions; rotation, position along and position beside start at `first`.
        first: Index of the rotation, or -1 if no hand holds the peg.
        grip_force: Grip force of the hand, N.
    """
    # Damping ratio of the peg on the pads' shear; assumed for soft rubber under a peg with friction.
    loss = 0.4
    if first < 0:
        return
    half, friction, shear = (words[PADS], words[PADS + 1]), words[PADS + 2], words[PADS + 3]
    tip, beside = words[PEG] - qpos[first + 1], qpos[first + 2]
    reach, flat = (tip, words[PEG + 1] - tip), words[PEG + 2]
    limits = grip_limits(qpos[first], beside, grip_force, reach, half, friction, flat)
    words[FORCE], words[TORQUE], words[CONTACT] = limits.force, limits.torque, limits.length
    words[ALONG], words[BESIDE] = -limits.middle, beside
    # Uniform shear over the contact length l: k_r = k l² / 12.
    turning = shear * limits.length**2 / 12
    # Damping c = 2 zeta sqrt(k m), for the rotation with k_r and the inertia.
    words[STIFFNESS], words[TURNING] = shear, turning
    words[DAMPING] = 2.0 * loss * math.sqrt(shear * (MASS + words[PEG + 3]))
    words[TURN_DAMPING] = 2.0 * loss * math.sqrt(turning * (TURNING_INERTIA + words[PEG + 4]))


@njit(cache=True, inline="always")
def act(words: Vector, qpos: Vector, qvel: Vector, qfrc: Vector, first: int) -> None:  # pragma: no cover
    """Add the forces of the pads on the peg, for the coming step, to the applied forces.

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
