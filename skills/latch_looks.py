"""Look for the latch of a hole without a switch on several ways down to the bottom; pure.

    way down -> rest -> the curve shows the latch: seated
                    `-> it does not: draw the peg up through the latch, push again, and look once more

Each way down is judged once, where the peg first rests at the bottom. A curve that went on while a hand shakes a peg at the bottom would be judged
until it passes.
"""

import math
from dataclasses import dataclass, field, replace

from drivers.parts import Latch
from drivers.quantities import ImpedanceSetpoint
from skills.contract import Observation
from skills.seating import BORNE_FOR, DOUBTED
from skills.signature import BEFORE, Curve

MOST_LOOKS = 3
"""Ways down after which a peg whose latch none has shown is given up. Source: decision 0104."""
TURNING_BACK = 0.05
"""Speed at which the setpoint goes from push to pull and back, m/s."""


@dataclass(frozen=True, slots=True)
class Looks:
    """The ways down so far, and the pull that draws the peg up for another one."""

    curve: Curve = field(default_factory=Curve)
    """Force against height on the way down that goes on."""
    missed: int = 0
    """Number of ways down that have shown no latch."""
    is_shown: bool = False
    """Whether a way down has shown the latch, with the bottom behind it."""
    top: float = -math.inf
    """Height of the hand up to which the peg is drawn up, m, base frame; lower than any while it is pushed."""
    pull: float = -math.inf
    """Height of the setpoint over the tip at the last scan, m, negative for a push; lower than any before the first look is over."""

    @property
    def is_over(self) -> bool:
        """Whether there have been enough ways down that have shown no latch."""
        return self.missed >= MOST_LOOKS

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
        if told.is_of(latch):
            return replace(self, curve=curve, is_shown=True)
        return replace(self, curve=curve, missed=self.missed + 1, top=height + latch.height + BEFORE)

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
