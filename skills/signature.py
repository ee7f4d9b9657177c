"""Force against height of a held peg on its ways down a hole, as far as something bears it at the end; pure.

    hand's height, force along z                                       drawn up: one way more
    of the scans in which the peg goes  -->  Curve of the present way  -->  rest: `told_by` of this way and those that ended at its height
    deeper than ever before

The hole guides the peg, so that the hand's height tells differences of the end's without theta, and at one attitude.
"""

import math
from dataclasses import dataclass, field, replace

from drivers.parts import Latch
from drivers.quantities import ImpedanceSetpoint
from skills.contract import Observation
from skills.latch_likelihood import BEFORE, PLACE, Signature, Way, told_by, unlikelihood
from skills.seating import Footing

STEP = 2e-5
"""Least way by which the peg has to go deeper than ever before for a scan to count, m; the arm's height scatters by less."""
LIFTED = 0.002
"""Height above its deepest place from which a held peg counts as drawn out again, m."""
MOST_WAYS = 64
"""Number of the last ways down that are kept: those of ten attempts with five looks each, and some that ended elsewhere."""


@dataclass(frozen=True, slots=True)
class Curve:
    """Force against height of a held peg on its way down, and whether something bears it now."""

    heights: tuple[float, ...] = ()
    """Heights of the hand, falling, m, base frame."""
    forces: tuple[float, ...] = ()
    """Force on the hand along z at each, N."""
    footing: Footing = field(default_factory=Footing)
    """Rest of the peg on what bears it."""
    has_rested: bool = False
    """Whether something has borne the peg at the end of this way for long enough."""
    earlier: tuple[Way, ...] = ()
    """Ways down of the same held peg that ended in a rest, before it was drawn up."""

    @property
    def ways(self) -> tuple[Way, ...]:
        """Ways down of this held peg that have ended in a rest, with the present one."""
        return (*self.earlier, *((Way(self.heights, self.forces),) if self.has_rested else ()))[-MOST_WAYS:]

    def after(self, seen: Observation, setpoint: ImpedanceSetpoint | None, latch: Latch) -> "Curve":
        """Return the curve after one more scan with the setpoint that was followed in it; a peg that is not held ends it, and one that is
        drawn up begins another way.

        While something bears the peg the curve stays as it is: what goes on are fingers that slide down the peg.
        """
        height, force = float(seen.arm.tcp.position[2]), float(seen.arm.wrench.force[2])
        if not seen.gripper.is_gripping or not math.isfinite(height + force):
            return Curve()
        deepest = self.heights[-1] if self.heights else math.inf
        is_rising = len(self.heights) == 1 and height > deepest
        if math.isfinite(deepest) and (is_rising or height > deepest + LIFTED):
            return Curve((height,), (force,), earlier=self.ways)
        footing = self.footing.after(seen, setpoint)
        if height > deepest - STEP or footing.is_firm(seen.stamp):
            return replace(self, footing=footing, has_rested=self.has_rested or footing.is_firm(seen.stamp))
        # The latch may be met at once and a half its height above where the peg now is, and what is before it counts as well.
        reach = height + 1.5 * latch.height + BEFORE
        first = next((at for at, above in enumerate(self.heights) if above <= reach), len(self.heights))
        heights, forces = (*self.heights[first:], height), (*self.forces[first:], force)
        # What gave way was no bottom.
        return Curve(heights, forces, footing, earlier=self.earlier)

    def signature(self, latch: Latch, now: float) -> Signature | None:
        """Return what the curve and the earlier ways that ended at this height say of the latch, where the peg rests at the time `now`, s,
        after a way that shows it; else None.
        """
        if not self.footing.is_firm(now) or unlikelihood(Way(self.heights, self.forces), latch) is None:
            return None
        near = [way for way in self.earlier if abs(way.heights[-1] - self.heights[-1]) <= PLACE]
        return told_by([*near, Way(self.heights, self.forces)], latch)
