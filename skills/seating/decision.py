"""Decision on the seating of the peg: the switch decides, and the depth of the tip must agree; pure."""

import math
from dataclasses import dataclass

from drivers.errors import SwitchDisagreesError, SwitchUnknownError
from drivers.parts import Hole
from drivers.quantities import ImpedanceSetpoint, SwitchState, Vector
from drivers.skin.layout import SOFTEST_SHEAR
from skills.contract import Observation

CLOSED_TOLERANCE = 0.004
"""Largest difference between the tip's depth, measured by the arm, and the hole's depth while the switch is closed, m; it allows for the error of theta. Source: chosen, not measured."""
OPEN_TOLERANCE = 0.0015
"""Distance from the hole's depth, m; a tip that is nearer should have closed the switch. Source: chosen, not measured."""

MOST_SHALLOW = 0.001
"""Largest shortfall from the hole's depth, m, by the surface estimate of the search, at which the peg is seated as soon as the switch closes. Source: chosen, not measured."""
DOUBTED = 0.002
"""Largest shortfall from the hole's depth at which a peg at rest on the bottom is seated, m. The arm measures surface and tip at two attitudes
of the hand. The error of their difference is 0.4 mm, and 0.5 mm in a cell with twice the errors. Source: decision 0021.
"""
MOST_DEEP = 0.002
"""Largest depth beyond the hole's depth, m, by the surface estimate of the search, at which the peg is seated as soon as the switch closes. If the
hole has pushed the peg up in the hand, the peg appears deeper. Beyond this limit it must rest on the bottom. Source: decision 0021.
"""
BORNE_FOR = 0.2
"""Least time of a rest under a push, s; a guided peg descends by millimetres in this time. Source: chosen, not measured."""
BORNE_WITHIN = 3e-4
"""Largest change of the tip's height during a rest, m. Source: chosen, not measured."""
LEAST_PUSH = 4.0
"""Least push during a rest, N; joint friction alone can hold the hand against a smaller push. Source: chosen, not measured."""
GIVE = 1.0 / SOFTEST_SHEAR
"""Compliance of the softest pads along a peg that is on the bottom: travel of the hand over the push, m/N. Source: derived for `SOFTEST_SHEAR`."""


@dataclass(frozen=True, slots=True)
class Footing:
    """Rest of a pushed peg on the bottom or on another support."""

    height: float = math.inf
    """Height of the tip when it came to rest, m, base frame."""
    since: float = math.inf
    """Start of the rest under a push, s; infinite if the peg is not pushed."""
    push: float = 0.0
    """Push at the start of the rest, N."""

    def after(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> "Footing":
        """Return the footing after one more scan, in which the arm followed `setpoint`."""
        # Push of the spring along z: K_z (z - z*)
        height = float(seen.tip[2])
        push = 0.0 if setpoint is None else float(setpoint.stiffness[2] * (height - setpoint.tip[2]))
        if push < LEAST_PUSH:
            return Footing()
        if abs(height - self.height) <= BORNE_WITHIN:
            return self
        return Footing(height, seen.stamp, push)

    def is_firm(self, now: float) -> bool:
        """Return True if the rest has lasted `BORNE_FOR` at the time `now`, s."""
        return now - self.since >= BORNE_FOR


@dataclass(frozen=True, slots=True)
class Arrival:
    """Arrival of the peg at the bottom, over the scans with a closed switch."""

    is_doubted: bool | None = None
    """True if the depth at which the switch closed leaves doubt about the seating; None before the switch closed."""
    footing: Footing = Footing()

    def after(self, seen: Observation, setpoint: ImpedanceSetpoint | None, short: float) -> "Arrival":
        """Return the arrival after one more scan with a closed switch.

        Args:
            seen: The scan.
            setpoint: Setpoint followed during the scan.
            short: Hole's depth minus the peg's depth, by the surface estimate of the search, m.
        """
        is_doubted = self.is_doubted
        if is_doubted is None:
            is_doubted = MOST_SHALLOW < short <= DOUBTED or short < -MOST_DEEP
        return Arrival(is_doubted, self.footing.after(seen, setpoint))

    def is_over(self, now: float) -> bool:
        """Return True if a push beyond the time `now`, s, gives no further information.

        This holds if the depth alone decides the seating, if the peg rests, or if the push is too weak for a rest.
        """
        return not self.is_doubted or self.footing.is_firm(now) or self.footing.since == math.inf


def depth_of(tip: Vector, hole: Hole) -> float:
    """Return the depth of the tip below the stated surface, measured by the arm, m."""
    return float(hole.centre[2] - tip[2])


def is_seated(switch: SwitchState, depth: float, hole: Hole) -> bool:
    """Return True if the switch is closed; check that the tip is then at the hole's depth.

    Args:
        switch: State of the switch.
        depth: Depth of the tip, measured by the arm, m, below the surface estimate of the search if there is one, otherwise
            below the stated surface.
        hole: The hole of the job.

    Raises:
        SwitchDisagreesError: The switch is closed, but the tip is not at the hole's depth.
        SwitchUnknownError: The state of the switch is unknown.
    """
    if switch is SwitchState.UNKNOWN:
        raise SwitchUnknownError("switch: state unknown; closed or open needed")
    if switch is SwitchState.OPEN:
        return False
    if abs(depth - hole.depth) > CLOSED_TOLERANCE:
        raise SwitchDisagreesError(
            f"switch closed with the tip {depth * 1e3:.1f} mm deep; {hole.depth * 1e3:.1f} mm "
            f"+- {CLOSED_TOLERANCE * 1e3:.0f} mm expected"
        )
    return True


def require_short_of_bottom(depth: float, hole: Hole) -> None:
    """Check, after the time for seating the peg, that an open switch is plausible.

    Raises:
        SwitchDisagreesError: The tip is at the bottom.
    """
    if abs(depth - hole.depth) <= OPEN_TOLERANCE:
        raise SwitchDisagreesError(
            f"switch open with the tip {depth * 1e3:.1f} mm deep; closed expected at {hole.depth * 1e3:.1f} mm "
            f"+- {OPEN_TOLERANCE * 1e3:.1f} mm"
        )
