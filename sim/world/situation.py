"""Situation of the peg and conditions for its changes: pure decisions.

The peg is always in one of three situations. `FREE`: a separate body in the rack, between the pads, in the hole, or
dropped. `HELD`: held by the hand. `GONE`: out of play, removed with its workpiece or by a person.
"""

import math
from enum import Enum

import numpy as np

from drivers.quantities import Vector
from sim.world import scene

SETTLED_GRIP = 0.05
"""Time for which the pads must hold the peg clear of the rack before it is in the `HELD` situation, s."""
LOST_TURN = scene.HINGE_RANGE - math.radians(2.0)
"""Hinge angle at which the peg meets the palm and drops out, rad."""
LEAST_CONTACT = 2e-3
"""Smallest length of the peg between the pads, m; below it the peg drops out."""


class PegSituation(Enum):
    """Situation of the peg."""

    FREE = "free"
    HELD = "held"
    GONE = "gone"


def has_fallen(height: float, speeds: Vector) -> bool:
    """Return True if a free peg has toppled over, has left the plate, or spins too fast for the integration.

    Args:
        height: Height of the peg's back end above the surface below it, or of the peg's lowest point above the table,
            whichever is smaller, m.
        speeds: Linear, then angular velocity of the peg, shape (6,), m/s and rad/s.
    """
    # Limit of the angular velocity, rad/s. A falling peg does not reach it. A peg squeezed out of the pads or the hole can
    # exceed it; the explicit steps of its gyroscopic torque would then grow without bound.
    return height < 0.0 or float(np.abs(speeds[3:]).max()) > 100.0


def is_in_grip(pad_force: float, grip_force: float, height: float) -> bool:
    """Return True if the pads carry the peg, clear of the rack.

    Args:
        pad_force: Smaller of the forces between the pads and the peg, N.
        grip_force: Closing force commanded, N.
        height: Height of the peg's lowest point above the rack, m.
    """
    # Share of the closing force with which both pads must press the peg, fraction.
    # Height of the peg's lowest point above the rack from which the peg is clear, m.
    return pad_force > 0.5 * grip_force > 0.0 and height > 1e-3


def may_rest(is_resting: bool, gap: float, loose_for: float, speeds: Vector) -> bool:
    """Return True if a free peg can be left out of the physics: it is at rest and no pad can reach it.

    Args:
        is_resting: True if the peg is left out already.
        gap: Lower bound of the distance between pads and peg, m.
        loose_for: Time since the peg was released or was last in reach, s.
        speeds: Linear, then angular velocity of the peg, shape (6,), m/s and rad/s.
    """
    # Upper limits of the speeds of a peg at rest, m/s and rad/s; after 0.02 s of free fall a peg moves at 0.2 m/s.
    at_rest = (1e-4, 1e-2)
    # Gap between pads and peg that no hand closes in the 10 ms before the next check, m.
    if gap <= 0.01:
        return False
    # Least time since a free peg was released, or was last in reach of the pads, before it may be left out, s.
    if is_resting or loose_for < 0.02:
        return is_resting
    size = np.abs(speeds)
    return bool(size[:3].max() < at_rest[0] and size[3:].max() < at_rest[1])
