"""Start of a search: distribution of the hole's place, and the area that earlier attempts of the run left unsearched; pure."""

import math
from dataclasses import dataclass, replace

from drivers.parts import HolePrior
from skills.search.decoys import Decoy
from skills.search.tour import Left

FOUND = 0.2
"""Standard deviation of the hole's middle about the lowest point of the peg that has fallen in, share of the hole's width."""
TRIES = 2
"""Number of tries at one place, after which the next attempt looks where no attempt has been yet."""


@dataclass(frozen=True, slots=True)
class Belief:
    """Where a search begins and how it goes on."""

    likely: HolePrior | None = None
    """Where the hole is likely; None is anywhere in the area."""
    left: Left | None = None
    """Rest of the path over the area that earlier attempts of the run did not sweep; None where there was none."""
    failed: tuple[tuple[float, float], ...] = ()
    """Places where the peg was tried and did not go in, in turn, m, base frame."""
    decoys: tuple[Decoy, ...] = ()
    """Decoys that were found."""

    def past(self, decoy: Decoy, left: Left | None) -> "Belief":
        """Return what the next attempt begins with, after a decoy: it goes on with what is left of the area."""
        return replace(self, likely=None, left=left, failed=(*self.failed, decoy.place), decoys=(*self.decoys, decoy))

    def after(self, place: tuple[float, float], width: float, left: Left | None) -> "Belief":
        """Return what the next attempt begins with, after the peg that fell at a place did not go in.

        The peg did fall there, so that it is tried there again: a lost hole is more likely than no hole. Once it has failed there
        `TRIES` times, the next attempt goes on with what is left of the area.

        Args:
            place: Lowest point of the peg when it had fallen in, shape (2,), m, base frame.
            width: Diameter of the largest circle inside the hole, m.
            left: Rest of the attempt's path over the area.
        """
        again = HolePrior(mean=place, deviation=(FOUND * width, FOUND * width))
        is_again = (self.tries_at(place, width) + 1) % TRIES > 0
        return replace(self, likely=again if is_again else None, left=left, failed=(*self.failed, place))

    def tries_at(self, place: tuple[float, float], width: float) -> int:
        """Return the number of tries at a place, shape (2,), m, base frame, that failed; `width` is that of the hole, m."""
        return sum(math.dist(place, other) < width for other in self.failed)
