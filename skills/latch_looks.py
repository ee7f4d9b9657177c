"""Look for the latch of a hole without a switch on several ways down to the bottom; pure.

    way down -> rest -> all ways so far show the latch: seated
                    |-> they do not yet: draw the peg up through the latch, push again, and look once more
                    `-> surely another latch or bottom, or there have been enough: given up

Each way down counts once, where the peg first rests at the bottom, and is judged together with those before it. A peg that is judged anew on each way until
it passes is judged too often, and so is a curve that goes on while a hand shakes the peg at the bottom.
"""

import math
from dataclasses import dataclass, field, replace

from drivers.parts import Latch
from drivers.quantities import ImpedanceSetpoint
from skills.contract import Observation
from skills.latch_likelihood import BEFORE, Signature
from skills.seating import BORNE_FOR, DOUBTED
from skills.signature import Curve

MOST_LOOKS = 5
"""Ways down after which a peg whose latch they have not shown is given up; chosen, not measured: looks add up, and each takes two seconds.
Source: decision 0022.
"""
LEAST_LOOKS = 2
"""Ways down before a peg is given up, however sure the first is: the peg may have been wedged just above the bottom. Source: decision 0022."""
TURNING_BACK = 0.05
"""Speed at which the setpoint goes from push to pull and back, m/s."""


@dataclass(frozen=True, slots=True)
class Looks:
    """The ways down so far, and the pull that draws the peg up for another one."""

    curve: Curve = field(default_factory=Curve)
    """Force against height on the way down that goes on."""
    missed: int = 0
    """Number of ways down to the bottom after which the latch was not shown."""
    is_over: bool = False
    """Whether there have been enough of them."""
    is_shown: bool = False
    """Whether the ways down have shown the latch, with the bottom behind it."""
    top: float = -math.inf
    """Height of the hand up to which the peg is drawn up, m, base frame; lower than any while it is pushed."""
    pull: float = -math.inf
    """Height of the setpoint over the tip at the last scan, m, negative for a push; lower than any before the first look is over."""

    @property
    def is_lifting(self) -> bool:
        """Whether the peg is drawn up."""
        return math.isfinite(self.top)

    def after(self, seen: Observation, setpoint: ImpedanceSetpoint | None, latch: Latch, beyond: float) -> "Looks":
        """Return the looks after one more scan.

        Args:
            seen: The scan.
            setpoint: Setpoint that was followed in it.
            latch: The latch as the recipe states it.
            beyond: Depth of the tip beyond the hole's, below the surface that the search has felt, m; a rest is one at the bottom if it is
                within `DOUBTED`.
        """
        height, curve = float(seen.arm.tcp.position[2]), self.curve.after(seen, setpoint, latch)
        if self.is_lifting:
            return replace(self, curve=curve, top=self.top if height < self.top else -math.inf)
        # The gate sees the same rest by itself, and may count it from a later scan.
        told = curve.signature(latch, seen.stamp - BORNE_FOR)
        if told is None or abs(beyond) > DOUBTED:
            return replace(self, curve=curve)
        if told.is_sure:
            return replace(self, curve=curve, is_shown=True)
        missed = self.missed + 1
        top = height + latch.height + BEFORE
        return replace(self, curve=curve, missed=missed, is_over=is_enough(missed, told), top=top)

    def pulling(self, push: float, period: float) -> "Looks":
        """Return the looks with the pull of the scan that begins now.

        Args:
            push: Depth of a pushing setpoint below the tip, m.
            period: Time since the last scan, s.
        """
        if self.missed == 0:
            return replace(self, pull=-push)
        goal, most = push if self.is_lifting else -push, TURNING_BACK * period
        return replace(self, pull=self.pull + min(max(goal - self.pull, -most), most))


def is_enough(ways: int, told: Signature) -> bool:
    """Return whether so many ways down, which have not shown the latch, are enough to give the peg up."""
    return ways >= (LEAST_LOOKS if told.is_refuted else MOST_LOOKS)
