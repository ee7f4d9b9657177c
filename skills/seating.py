"""Is the peg in? The switch decides, and the depth of the tip must agree with it."""

from dataclasses import dataclass

from drivers.errors import SwitchDisagreesError, SwitchUnknownError
from drivers.parts import Hole
from drivers.quantities import SwitchState, Vector

DEPTH_TOLERANCE = 0.004
"""Between the tip's depth by the arm and the hole's depth, m: in-hand length and theta are known no better."""
CLOSING_TIME = 5.0
"""The tip may stay at the hole's depth for so long without the switch closing, s."""


@dataclass(slots=True)
class Seating:
    """Watches switch and depth through one skill."""

    hole: Hole
    _deep_since: float | None = None

    def depth(self, tip: Vector) -> float:
        """Return the depth of the tip below the surface by the arm, m."""
        return float(self.hole.centre[2] - tip[2])

    def is_seated(self, switch: SwitchState, tip: Vector, stamp: float) -> bool:
        """Return whether the switch is closed, and the tip as deep as it should then be.

        Args:
            switch: What is known of it.
            tip: End point of the peg by the arm, shape (3,), m, base frame.
            stamp: When, s.

        Raises:
            SwitchDisagreesError: Closed with the tip elsewhere, or open with the tip at the bottom for too long.
            SwitchUnknownError: The switch gives no valid answer.
        """
        depth = self.depth(tip)
        if switch is SwitchState.UNKNOWN:
            raise SwitchUnknownError("switch: state unknown; closed or open needed")
        if switch is SwitchState.CLOSED:
            if abs(depth - self.hole.depth) > DEPTH_TOLERANCE:
                raise SwitchDisagreesError(
                    f"switch closed with the tip {depth * 1e3:.1f} mm deep; {self.hole.depth * 1e3:.1f} mm "
                    f"+- {DEPTH_TOLERANCE * 1e3:.0f} mm expected"
                )
            return True
        if abs(depth - self.hole.depth) > DEPTH_TOLERANCE:
            self._deep_since = None
        elif self._deep_since is None:
            self._deep_since = stamp
        elif stamp - self._deep_since > CLOSING_TIME:
            raise SwitchDisagreesError(
                f"switch open for {CLOSING_TIME} s with the tip {depth * 1e3:.1f} mm deep; closed expected from "
                f"{self.hole.depth * 1e3:.1f} mm"
            )
        return False
