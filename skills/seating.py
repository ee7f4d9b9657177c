"""Judge whether the peg is seated: the switch decides, and the depth of the tip has to agree with it; pure."""

import math
from dataclasses import dataclass

from drivers.errors import SwitchDisagreesError, SwitchUnknownError
from drivers.parts import Hole
from drivers.quantities import ImpedanceSetpoint, SwitchState, Vector
from skills.contract import Observation

CLOSED_TOLERANCE = 0.004
"""Largest difference between the tip's depth by the arm and the hole's depth when the switch closes, m; theta is known
no better.
"""
OPEN_TOLERANCE = 0.0015
"""Distance from the hole's depth within which a tip that can be pushed no further should have closed the switch, m."""

MOST_SHALLOW = 0.001
"""Largest depth that a peg may be short of the hole's where the switch closes, from the surface that its search has felt, m; such a peg counts as
seated at once.
"""
DOUBTED = 0.002
"""Largest depth that a peg may be short of the hole's, m, where the bottom bears it: surface and tip are measured with the hand at two
attitudes, and err by 0.4 mm against each other, by 0.5 mm where a cell errs twice as much. Source: decision 0021.
"""
MOST_DEEP = 0.002
"""Largest depth beyond the hole's at which a peg counts as seated at once where the switch closes, from the surface that its search has felt, m: a peg
looks deeper that the hole has pushed up in the hand since. One that looks deeper still is seated where the bottom bears it. Source: decision 0021.
"""
BORNE_FOR = 0.2
"""Time for which the bottom has to bear a peg that is pushed, s; one that is guided goes down by millimetres in it."""
BORNE_WITHIN = 3e-4
"""Largest change of the tip's height in that time, m."""
LEAST_PUSH = 4.0
"""Least push that something has to bear, N; friction in the joints of an arm holds the hand against less."""


@dataclass(frozen=True, slots=True)
class Footing:
    """Rest of a peg that is pushed down a hole on what bears it."""

    height: float = math.inf
    """Height of the tip when it came to rest, m, base frame."""
    since: float = math.inf
    """Time since which it has been pushed there, s; infinite where it is not."""

    def after(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> "Footing":
        """Return the footing after one more scan with the setpoint that was followed; the push is the spring's along z."""
        height = float(seen.tip[2])
        if setpoint is None or float(setpoint.stiffness[2] * (height - setpoint.tip[2])) < LEAST_PUSH:
            return Footing()
        if abs(height - self.height) <= BORNE_WITHIN:
            return self
        return Footing(height, seen.stamp)

    def is_firm(self, now: float) -> bool:
        """Return whether the peg has been borne for long enough at the time `now`, s."""
        return now - self.since >= BORNE_FOR


@dataclass(frozen=True, slots=True)
class Arrival:
    """What the scans with a closed switch tell of a peg that arrives at the bottom."""

    is_doubted: bool | None = None
    """Whether the depth at which the switch closed leaves open whether the peg is seated; None before it closed."""
    footing: Footing = Footing()

    def after(self, seen: Observation, setpoint: ImpedanceSetpoint | None, short: float) -> "Arrival":
        """Return what is known after one more scan with a closed switch.

        Args:
            seen: The scan.
            setpoint: Setpoint that was followed in it.
            short: How much the peg is short of the hole's depth, from the surface that its search has felt, m.
        """
        is_doubted = self.is_doubted
        if is_doubted is None:
            is_doubted = MOST_SHALLOW < short <= DOUBTED or short < -MOST_DEEP
        return Arrival(is_doubted, self.footing.after(seen, setpoint))

    def is_over(self, now: float) -> bool:
        """Return whether pushing on tells nothing more at the time `now`, s: the depth is beyond doubt, something bears the peg, or the
        push is too weak to tell.
        """
        return not self.is_doubted or self.footing.is_firm(now) or self.footing.since == math.inf


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
