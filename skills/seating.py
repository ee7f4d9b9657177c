"""Judge whether the peg is seated: the switch decides, and the depth of the tip has to agree with it."""

from drivers.errors import SwitchDisagreesError, SwitchUnknownError
from drivers.parts import Hole
from drivers.quantities import SwitchState, Vector

CLOSED_TOLERANCE = 0.004
"""Largest difference between the tip's depth by the arm and the hole's depth when the switch closes, m; theta is known
no better.
"""
OPEN_TOLERANCE = 0.0015
"""Distance from the hole's depth within which a tip that can be pushed no further should have closed the switch, m."""


def depth_of(tip: Vector, hole: Hole) -> float:
    """Return the depth of the tip below the surface by the arm, m."""
    return float(hole.centre[2] - tip[2])


def is_seated(switch: SwitchState, tip: Vector, hole: Hole) -> bool:
    """Return whether the switch is closed, after a check that the tip is then at the hole's depth.

    Args:
        switch: State of the switch.
        tip: End point of the peg by the arm, shape (3,), m, base frame.
        hole: The hole as the job states it.

    Raises:
        SwitchDisagreesError: The switch is closed, and the tip is elsewhere.
        SwitchUnknownError: The switch gives no valid answer.
    """
    if switch is SwitchState.UNKNOWN:
        raise SwitchUnknownError("switch: state unknown; closed or open needed")
    if switch is SwitchState.OPEN:
        return False
    depth = depth_of(tip, hole)
    if abs(depth - hole.depth) > CLOSED_TOLERANCE:
        raise SwitchDisagreesError(
            f"switch closed with the tip {depth * 1e3:.1f} mm deep; {hole.depth * 1e3:.1f} mm "
            f"+- {CLOSED_TOLERANCE * 1e3:.0f} mm expected"
        )
    return True


def require_short_of_bottom(tip: Vector, hole: Hole) -> None:
    """Make sure that an open switch is plausible, after all the time to seat the peg is spent.

    Raises:
        SwitchDisagreesError: The tip is at the bottom.
    """
    depth = depth_of(tip, hole)
    if abs(depth - hole.depth) <= OPEN_TOLERANCE:
        raise SwitchDisagreesError(
            f"switch open with the tip {depth * 1e3:.1f} mm deep; closed expected at {hole.depth * 1e3:.1f} mm "
            f"+- {OPEN_TOLERANCE * 1e3:.1f} mm"
        )
