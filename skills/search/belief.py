"""Start of a search: distribution of the hole's place, and the area that earlier attempts of the run left unsearched; pure."""

import math
from dataclasses import dataclass, replace

from drivers.parts import HolePrior
from skills.search.decoys import Decoy
from skills.search.tour import Left

FOUND = 0.2
"""Standard deviation of the hole's middle about the lowest point of a peg that has fallen in, share of the hole's width."""
TRIES = 2
"""Number of tries at one place, after which the next attempt searches the unsearched part of the area."""


@dataclass(frozen=True, slots=True)
class Belief:
    """Likely place of the hole, and results of earlier attempts, with which a search begins."""

    likely: HolePrior | None = None
    """Distribution of the hole's place; None if it is anywhere in the area."""
    left: Left | None = None
    """Rest of the path that earlier attempts of the run did not sweep; None if there was no earlier attempt."""
    failed: tuple[tuple[float, float], ...] = ()
    """Places at which the peg was tried and did not go in, in order, m, base frame."""
    decoys: tuple[Decoy, ...] = ()
    """Decoys found so far."""

    def past(self, decoy: Decoy, left: Left | None) -> "Belief":
        """Return the belief after a decoy: the next attempt continues with the rest of the area."""
        return replace(self, likely=None, left=left, failed=(*self.failed, decoy.place), decoys=(*self.decoys, decoy))

    def after(self, place: tuple[float, float], width: float, left: Left | None) -> "Belief":
        """Return the belief after the peg fell at a place but did not go in.

        The next attempt tries the same place again, because the peg probably lost the hole there. After `TRIES` failures at the
        place, the next attempt continues with the rest of the area.

        Args:
            place: Lowest point of the peg when it had fallen in, shape (2,), m, base frame.
            width: Diameter of the largest circle inside the hole, m.
            left: Rest of the attempt's path over the area.
        """
        again = HolePrior(mean=place, deviation=(FOUND * width, FOUND * width))
        is_again = (self.tries_at(place, width) + 1) % TRIES > 0
        return replace(self, likely=again if is_again else None, left=left, failed=(*self.failed, place))

    def tries_at(self, place: tuple[float, float], width: float) -> int:
        """Return the number of failed tries at a place, shape (2,), m, base frame; `width` is the hole's width, m."""
        return sum(math.dist(place, other) < width for other in self.failed)
