"""Force against height of a held peg over its insertion strokes, each up to a rest; pure.

    height and force along z of each      -->  StrokeCurve of the stroke   -->  if the peg is drawn up, a new stroke starts;
    scan that reaches a new largest depth                                       if it rests, `told_by` combines this stroke with
                                                                                earlier ones that ended at the same height

The hole guides the peg at a constant attitude. The height of the hand therefore measures differences of the end's height
without theta.
"""

import math
from dataclasses import dataclass, field, replace

from drivers.parts import Latch
from drivers.quantities import ImpedanceSetpoint
from skills.contract import Observation
from skills.seating.decision import Footing
from skills.seating.latch_likelihood import BEFORE, MOST_WAYS, PLACE, InsertionStroke, Signature, told_by, unlikelihood

STEP = 2e-5
"""Least new depth for a scan to be added to the curve, m; it exceeds the noise of the arm's height. Source: chosen, not measured."""
LIFTED = 0.002
"""Height above the deepest point at which a held peg counts as drawn up, m. Source: chosen, not measured."""


@dataclass(frozen=True, slots=True)
class StrokeCurve:
    """Force against height of a held peg in the present stroke, its rest at the end of this stroke, and the earlier strokes."""

    heights: tuple[float, ...] = ()
    """Heights of the hand, decreasing, m, base frame."""
    forces: tuple[float, ...] = ()
    """Force on the hand along z at each height, N."""
    footing: Footing = field(default_factory=Footing)
    """Rest of the peg on its support."""
    has_rested: bool = False
    """True if the peg has rested long enough at the end of this stroke."""
    earlier: tuple[InsertionStroke, ...] = ()
    """Earlier strokes of the same held peg that ended in a rest."""

    @property
    def ways(self) -> tuple[InsertionStroke, ...]:
        """Strokes of this held peg that have ended in a rest, including the present stroke if it has."""
        return (*self.earlier, *((self.present,) if self.has_rested else ()))[-MOST_WAYS:]

    @property
    def present(self) -> InsertionStroke:
        """Present stroke so far."""
        return InsertionStroke(self.heights, self.forces)

    def after(self, seen: Observation, setpoint: ImpedanceSetpoint | None, latch: Latch) -> "StrokeCurve":
        """Return the curve after one more scan, in which the arm followed `setpoint`.

        If the peg is not held, the curve is cleared. If the peg is drawn up, a new stroke starts. During a rest the heights and
        forces are unchanged, because the fingers then slide down the peg.
        """
        height, force = float(seen.arm.tcp.position[2]), float(seen.arm.wrench.force[2])
        if not seen.gripper.is_gripping or not math.isfinite(height + force):
            return StrokeCurve()
        deepest = self.heights[-1] if self.heights else math.inf
        # A stroke begins only once the hand sinks.
        if height > deepest + (0.0 if len(self.heights) == 1 else LIFTED):
            return StrokeCurve((height,), (force,), earlier=self.ways)
        footing = self.footing.after(seen, setpoint)
        if height > deepest - STEP or footing.is_firm(seen.stamp):
            return replace(self, footing=footing, has_rested=self.has_rested or footing.is_firm(seen.stamp))
        first = self._first_within(height + 1.5 * latch.height + BEFORE)
        heights, forces = (*self.heights[first:], height), (*self.forces[first:], force)
        # The hand has sunk further: if the peg had rested, its support was not the bottom, and the rest is discarded.
        return StrokeCurve(heights, forces, footing, earlier=self.earlier)

    def _first_within(self, reach: float) -> int:
        """Return the index of the first height of at most `reach`, m; points above it show neither the latch nor the force offset."""
        return next((at for at, above in enumerate(self.heights) if above <= reach), len(self.heights))

    def signature(self, latch: Latch, now: float) -> Signature | None:
        """Return the estimate of the latch from this stroke and the earlier strokes that ended at its height.

        The result is None if the peg does not rest at the time `now`, s, or if this stroke does not show the latch.
        """
        if not self.footing.is_firm(now) or unlikelihood(self.present, latch) is None:
            return None
        near = [way for way in self.earlier if abs(way.heights[-1] - self.heights[-1]) <= PLACE]
        return told_by([*near, self.present], latch)
