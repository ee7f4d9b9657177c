"""Knowledge about the peg in the hand, as one value; pure."""

from dataclasses import dataclass, replace

from skills.search.surface import Plane
from skills.seating.latch_likelihood import InsertionStroke

SLIPPED = 0.5
"""Factor on the assumed grip after each slip of the peg along the fingers, fraction."""
EXPLAINED = 1.5e-3
"""Largest difference between measured and known length of the peg that errors of theta, the plate's height and the arm may cause, m; the length
then stays. At the tilt of the search, 1 degree of theta is 0.9 mm of length, and 0.3 mm of height are 0.4 mm. Source: chosen, not measured."""


@dataclass(frozen=True, slots=True, eq=False)
class HeldPeg:
    """Knowledge about the peg in the hand since its grasp."""

    measured: float | None = None
    """Peg length minus nominal length, m, measured at the first touch-down; None before."""
    grip_share: float = 1.0
    """Assumed share of the grip after slips, fraction."""
    surface: Plane | None = None
    """Surface estimate of the last search that found the hole; None before."""
    ways: tuple[InsertionStroke, ...] = ()
    """Insertion strokes that ended in a rest, over all attempts."""

    @property
    def excess(self) -> float:
        """Peg length minus nominal length, m; 0 until measured."""
        return self.measured or 0.0

    @property
    def is_length_known(self) -> bool:
        """True if the peg has touched the plate."""
        return self.measured is not None

    def touched(self, excess: float) -> "HeldPeg":
        """Return the knowledge after the peg touched the plate `excess`, m, further from the hand than its known length.

        If the peg is now shorter by more than the error of two touch-downs, it has slipped up into the hand, and less grip is assumed.
        """
        has_slipped = self.is_length_known and excess < -2.0 * EXPLAINED
        share = SLIPPED * self.grip_share if has_slipped else self.grip_share
        return replace(self, measured=self.excess + excess, grip_share=share)
