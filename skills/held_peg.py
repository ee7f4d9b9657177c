"""Knowledge about the peg in the hand, as one value; pure."""

from dataclasses import dataclass, replace

from skills.search.surface import Plane
from skills.seating.latch_likelihood import InsertionStroke

SLIPPED = 0.5
"""Factor on the assumed grip after each slip of the peg along the fingers, fraction."""


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

    def slipped(self) -> "HeldPeg":
        """Return the knowledge after a slip of the peg along the fingers: the assumed grip is reduced."""
        return replace(self, grip_share=SLIPPED * self.grip_share)
