"""What no sensor tells: for records and tests, never for skills."""

from dataclasses import dataclass

from sim.situation import Peg

VOID_PENETRATION = 10e-6
VOID_SHARE = 0.2
"""A trial is void when the peg penetrates by more than 10 um, or this share of the radial clearance, for longer than 2 ms."""


@dataclass(frozen=True, slots=True)
class Truth:
    """The world as it is."""

    stamp: float
    peg: Peg
    theta: float
    """In-hand angle, rad; NaN when the peg is not held."""
    tip: tuple[float, float, float]
    """Middle of the peg's end face, m, base frame."""
    hole: tuple[float, float, float]
    """Middle of the hole's mouth, m, base frame."""
    depth: float
    """Of the tip below the hole's mouth along its axis, m; negative above."""
    is_in_hole: bool
    """The tip is below the surface and within the hole's radius of its axis."""
    switch_closed: bool
    peak_contact_force: float
    """Largest net force of the plates on the held peg, N, after a first-order low-pass of 5 ms (32 Hz)."""
    max_penetration: float
    """Deepest that lasted longer than 2 ms, in a bore or at its rim, m."""
    is_void: bool
    max_in_hand_rotation: float
    """Since the grasp, rad."""
    time_over_20N: float  # noqa: N815 - a column of trials.csv
    """Time that the force of which `peak_contact_force` is the largest exceeded 20 N, s."""
    plate_penetration: float
    """Deepest that lasted longer than 2 ms, of a surface or a hole's floor, m; recorded, not judged."""


def is_void(penetration: float, clearance: float) -> bool:
    """Whether a trial's physics cheated.

    Args:
        penetration: Deepest that lasted longer than 2 ms, in a bore or at its rim, m.
        clearance: Radial, of peg and hole, m.
    """
    return penetration > min(VOID_PENETRATION, VOID_SHARE * clearance)
