"""Detection of the latch of a hole without a switch, over several insertion strokes to the bottom; pure.

    stroke -> rest -> the strokes so far show the latch: seated
                  |-> they do not yet: draw the peg up through the latch and push again
                  `-> another latch or bottom, or too many strokes: give up

Each stroke counts once, at its first rest on the bottom, and is judged together with the strokes before it. If each stroke
were judged alone until one passed, or if a stroke were extended while the hand shakes the peg at the bottom, so many tests
would in the end accept a wrong part.
"""

import math
from dataclasses import dataclass, field, replace

from drivers.parts import Latch
from drivers.quantities import ImpedanceSetpoint
from skills.contract import Observation
from skills.seating.decision import BORNE_FOR, DOUBTED
from skills.seating.latch_likelihood import BEFORE, Signature
from skills.seating.signature import StrokeCurve

MOST_LOOKS = 5
"""Largest number of strokes without a detected latch; chosen, not measured: the evidence of the strokes accumulates, and each stroke takes
two seconds. Source: decision 0022.
"""
LEAST_LOOKS = 2
"""Least number of strokes before the skill gives up the peg, because in the first stroke the peg can have wedged just above the bottom. Source: decision 0022."""
TURNING_BACK = 0.05
"""Speed of the setpoint from push to pull and back, m/s. Source: chosen, not measured."""


@dataclass(frozen=True, slots=True)
class Looks:
    """Insertion strokes so far, and the pull that draws the peg up for another stroke."""

    curve: StrokeCurve = field(default_factory=StrokeCurve)
    """Force against height on the present stroke."""
    missed: int = 0
    """Number of strokes to the bottom after which the latch was not detected."""
    is_over: bool = False
    """True if the skill tries no further insertion stroke."""
    is_shown: bool = False
    """True if the strokes have shown the latch, with the bottom behind it."""
    top: float = -math.inf
    """Height of the hand at which the pull ends, m, base frame; -inf during a push."""
    pull: float = -math.inf
    """Height of the setpoint over the tip at the last scan, m, negative for a push; -inf before the first stroke is judged."""

    @property
    def is_lifting(self) -> bool:
        """True while the peg is drawn up."""
        return math.isfinite(self.top)

    def after(self, seen: Observation, setpoint: ImpedanceSetpoint | None, latch: Latch, beyond: float) -> "Looks":
        """Return the looks after one more scan.

        Args:
            seen: The scan.
            setpoint: Setpoint followed during the scan.
            latch: The latch of the recipe.
            beyond: Depth of the tip minus the hole's depth, by the surface estimate of the search, m; a rest is on the bottom if this
                difference is within `DOUBTED`.
        """
        height, curve = float(seen.arm.tcp.position[2]), self.curve.after(seen, setpoint, latch)
        if self.is_lifting:
            return replace(self, curve=curve, top=self.top if height < self.top else -math.inf)
        # The success gate detects the same rest independently, possibly one scan later.
        told = curve.signature(latch, seen.stamp - BORNE_FOR)
        if told is None or abs(beyond) > DOUBTED:
            return replace(self, curve=curve)
        if told.is_sure:
            return replace(self, curve=curve, is_shown=True)
        missed = self.missed + 1
        top = height + latch.height + BEFORE
        return replace(self, curve=curve, missed=missed, is_over=is_enough(missed, told), top=top)

    def pulling(self, push: float, period: float) -> "Looks":
        """Return the looks with the pull updated for the present scan.

        Args:
            push: Depth of a pushing setpoint below the tip, m.
            period: Time since the last scan, s.
        """
        if self.missed == 0:
            return self if self.pull == -push else replace(self, pull=-push)
        goal, most = push if self.is_lifting else -push, TURNING_BACK * period
        return replace(self, pull=self.pull + min(max(goal - self.pull, -most), most))


def is_enough(ways: int, told: Signature) -> bool:
    """Return True if the skill gives up the peg after `ways` strokes without a detected latch; `told` is the latest estimate."""
    return ways >= (LEAST_LOOKS if told.is_refuted else MOST_LOOKS)
