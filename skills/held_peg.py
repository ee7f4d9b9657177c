"""What is known of the peg in the hand, as one value; pure."""

from dataclasses import dataclass, replace

from skills.latch_likelihood import Way
from skills.surface import Plane
from skills.tactile.pose import NO_PEG, PegPose

SLIPPED = 0.5
"""Share of the believed grip that is counted on after each slip of the peg along the fingers, fraction."""


@dataclass(frozen=True, slots=True, eq=False)
class HeldPeg:
    """What is known of the peg in the hand since it was grasped."""

    pose: PegPose = NO_PEG
    """Newest healthy pose in the hand."""
    measured: float | None = None
    """Length by which the peg reaches further than the job states, m, by its first touch-down; None before."""
    grip_share: float = 1.0
    """Share of the believed grip that is left after slips, fraction."""
    surface: Plane | None = None
    """Plate's surface as the last search that found the hole has felt it; None before."""
    ways: tuple[Way, ...] = ()
    """Ways down to where something bore the peg, over all attempts."""

    @property
    def excess(self) -> float:
        """Length by which the peg is believed to reach further than the job states, m."""
        return self.measured or 0.0

    @property
    def is_length_known(self) -> bool:
        """Whether the peg has touched the plate."""
        return self.measured is not None

    def grasped_anew(self) -> "HeldPeg":
        """Return what is known of a peg that is about to be grasped."""
        return HeldPeg(self.pose)

    def slipped(self) -> "HeldPeg":
        """Return what is known after the peg has slipped along the fingers: less of the grip is counted on."""
        return replace(self, grip_share=SLIPPED * self.grip_share)
