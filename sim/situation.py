"""Where the peg is, and when it passes from one situation to the other: pure decisions.

The peg is at every time in one of three situations: a body of its own (`FREE`: in the rack, between the pads, in the
hole, where it fell), held by the hand (`HELD`), or out of play (`GONE`: taken away with its workpiece or by a person).
"""

import math
from enum import Enum

import numpy as np

from drivers.quantities import Vector
from sim import scene

SETTLED_GRIP = 0.05
"""Time for which the pads must have held the peg clear of the rack before it counts as held, s."""
SQUEEZED_SHARE = 0.5
"""Share of the closing force with which both pads must press the peg, fraction."""
CLEAR_OF_RACK = 1e-3
"""Height of the peg's lowest point over the rack from which on it is clear, m."""
LOST_TURN = scene.HINGE_RANGE - math.radians(2.0)
"""Hinge angle at which the peg meets the palm and drops out, rad."""
LEAST_CONTACT = 2e-3
"""Least length of the peg between the pads, m; a peg that is held by less drops out."""
SETTLING = 0.02
"""Time for which a free peg must have settled before it is left at rest, s."""
AT_REST = (1e-4, 1e-2)
"""Speeds of a peg that lies still, m/s and rad/s; one that fell would be at 0.2 m/s by then."""
OUT_OF_REACH = 0.01
"""Gap between pads and peg that no hand closes in the 10 ms until it is looked at again, m."""


class PegSituation(Enum):
    """Where the peg is."""

    FREE = "free"
    HELD = "held"
    GONE = "gone"


def has_fallen_out(turn: float, contact: float) -> bool:
    """Whether the pads have lost a held peg.

    Args:
        turn: Angle of the hinge, rad.
        contact: Length of the peg between the pads, m.
    """
    return abs(turn) > LOST_TURN or contact < LEAST_CONTACT


def is_in_grip(pad_force: float, grip_force: float, height: float) -> bool:
    """Whether the pads carry the peg, clear of the rack.

    Args:
        pad_force: Smaller of the forces between the pads and the peg, N.
        grip_force: Closing force commanded, N.
        height: Height of the peg's lowest point over the rack, m.
    """
    return pad_force > SQUEEZED_SHARE * grip_force > 0.0 and height > CLEAR_OF_RACK


def may_rest(is_resting: bool, gap: float, loose_for: float, speeds: Vector) -> bool:
    """Whether a free peg can be left out of the physics because it lies still and no pad can reach it.

    Args:
        is_resting: Whether the peg is left out already.
        gap: Distance that no pad is nearer than, m.
        loose_for: Time since the peg was let go or was last in reach, s.
        speeds: Linear, then angular velocity of the peg, shape (6,), m/s and rad/s.
    """
    if gap <= OUT_OF_REACH:
        return False
    if is_resting or loose_for < SETTLING:
        return is_resting
    size = np.abs(speeds)
    return bool(size[:3].max() < AT_REST[0] and size[3:].max() < AT_REST[1])
