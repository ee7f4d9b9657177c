"""True state of a simulated cell, beyond its sensors: for records and tests, never for skills."""

from dataclasses import dataclass

from sim.world.situation import PegSituation

VOID_PENETRATION = 10e-6
VOID_SHARE = 0.2
"""Penetration, m and as a share of the radial clearance, above which a trial is void if it lasts longer than 2 ms."""


@dataclass(frozen=True, slots=True)
class Truth:
    """The true state of the cell."""

    peg: PegSituation
    theta: float
    """In-hand angle, rad; NaN if the peg is not held."""
    tip: tuple[float, float, float]
    """Centre of the peg's end face, m, base frame."""
    hole: tuple[float, float, float]
    """Centre of the hole's mouth, m, base frame."""
    depth: float
    """Depth of the tip below the hole's mouth along its axis, m; negative above."""
    is_in_hole: bool
    """True if the tip is below the surface and within the hole's radius of its axis."""
    switch_closed: bool
    peak_contact_force: float
    """Largest net force of the plates on the held peg, N, after a first-order low-pass of 5 ms (32 Hz)."""
    max_penetration: float
    """Deepest penetration of a bore or its rim that lasted longer than 2 ms, m."""
    is_void: bool
    max_in_hand_rotation: float
    """Largest rotation of the peg in the hand since the grasp, rad."""
    grip_slip: float
    """Largest slip of the peg along and across the fingers since the last grasp, m."""
    time_over_20N: float  # noqa: N815 - a column of trials.csv
    """Time with a force above 20 N, s; the force is low-passed as for `peak_contact_force`."""
    jerk_free: float
    """Largest jerk of the finger centre in free space, m/s³, after a low-pass of 10 Hz, see `sim.world.metering`."""
    jerk_contact: float
    """Largest jerk of the finger centre at all other times, m/s³, after the same low-pass."""
    plate_penetration: float
    """Deepest penetration of a surface or a hole's floor that lasted longer than 2 ms, m; `is_void` does not use it."""
    joint_speed: float
    """Speed of the fastest joint, rad/s."""


def is_void(penetration: float, clearance: float) -> bool:
    """Return True if a trial is void because its bodies penetrated each other.

    Args:
        penetration: Deepest penetration of a bore or its rim that lasted longer than 2 ms, m.
        clearance: Radial clearance of peg and hole, m.
    """
    return penetration > min(VOID_PENETRATION, VOID_SHARE * clearance)
