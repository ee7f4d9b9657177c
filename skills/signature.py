"""Tell a part that went through its latch to the bottom by the force that it took at each depth; pure.

    hand's height, force along z            least absolute deviations         thresholds
    of the scans in which the peg   -->  F f((y - s) / h) + c, y above  -->  F, s, and what is left  -->  Signature.is_of
    goes deeper than ever before         the place where it rests            over

The hole guides the peg, so that the hand's height tells differences of the end's without theta, and at one attitude. What the arm reports as a
force errs by some newtons that stay as they are over a few millimetres; the constant c takes them out.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from drivers.parts import Latch
from drivers.quantities import ImpedanceSetpoint, Vector
from skills.contract import Observation
from skills.seating import Footing

STEP = 2e-5
"""Least way by which the peg has to go deeper than ever before for a scan to count, m; the arm's height scatters by less."""
LIFTED = 0.002
"""Height above its deepest place from which a held peg counts as drawn out again, m."""
BEFORE = 0.0015
"""Way above the latch that tells what the arm reports where nothing resists, m."""
GRID = 5e-5
"""Distance between the heights at which curve and latch are compared, m."""
FLOOR = 2e-4
"""Height above the resting place from which the curve counts, m: below it the bottom bears the push already."""
SHEAR = 2e-5
"""Way by which the pads give along the fingers, m/N; assumed: two pads of rubber of 60 kPa shear modulus, 180 mm² each, 0.4 mm of them left
under the grip. An error by its half moves the measured place by 0.1 mm.
"""
LEAST_POINTS = 8
"""Least number of scans in the curve; fewer do not show its shape."""
FORCE_SHARE = 0.5
"""Share of the stated force, and its inverse, that the measured one must lie between, fraction: halfway between a latch that is worn out and
one as stated.
"""
PLACE = 0.0005
"""Largest difference between the measured height of the latch above the bottom and the stated one, m: halfway to a bottom that is 1 mm higher."""
MISFIT = 0.7
"""Largest deviation of the curve, by its median, as a share of the swing of the latch itself, fraction: but for outliers its shape explains two thirds
of the variance. The noise of an arm that reports a force to 1 N is half of the swing of a latch of 4 N.
"""
ROUNDS = 12
"""Rounds of reweighting by which the deviations are made least."""
EXACT = 0.1
"""Deviation below which all weigh the same, N."""
DEVIATION = 1.4826
"""Standard deviation of normal noise over the median of its size."""


@dataclass(frozen=True, slots=True)
class Signature:
    """What the curve of a part that rests says of its latch."""

    force: float
    """Force of the latch, N."""
    offset: float
    """Height of the latch over the stated one, m."""
    misfit: float
    """Deviation of the curve from it over the latch's swing at that force, ratio."""

    def is_of(self, latch: Latch) -> bool:
        """Return whether this is the latch as the recipe states it, with the bottom where it should be."""
        share = self.force / latch.force
        return FORCE_SHARE <= share <= 1.0 / FORCE_SHARE and abs(self.offset) <= PLACE and self.misfit <= MISFIT


@dataclass(frozen=True, slots=True)
class Curve:
    """Force against height of a held peg on its way down, and whether something bears it now."""

    heights: tuple[float, ...] = ()
    """Heights of the hand, falling, m, base frame."""
    forces: tuple[float, ...] = ()
    """Force on the hand along z at each, N."""
    footing: Footing = field(default_factory=Footing)
    """Rest of the peg on what bears it."""

    def after(self, seen: Observation, setpoint: ImpedanceSetpoint | None, latch: Latch) -> "Curve":
        """Return the curve after one more scan with the setpoint that was followed in it; a peg that is not held or drawn out again ends it.

        While something bears the peg the curve stays as it is: what goes on are fingers that slide down the peg.
        """
        height, force = float(seen.arm.tcp.position[2]), float(seen.arm.wrench.force[2])
        if not seen.gripper.is_gripping or not math.isfinite(height + force):
            return Curve()
        deepest = self.heights[-1] if self.heights else math.inf
        is_rising = len(self.heights) == 1 and height > deepest
        if math.isfinite(deepest) and (is_rising or height > deepest + LIFTED):
            return Curve((height,), (force,))
        footing = self.footing.after(seen, setpoint)
        if height > deepest - STEP or footing.is_firm(seen.stamp):
            return replace(self, footing=footing)
        # The latch may be met at once and a half its height above where the peg now is, and what is before it counts as well.
        reach = height + 1.5 * latch.height + BEFORE
        first = next((at for at, above in enumerate(self.heights) if above <= reach), len(self.heights))
        return Curve((*self.heights[first:], height), (*self.forces[first:], force), footing)

    def signature(self, latch: Latch, now: float) -> Signature | None:
        """Return what the curve says of the latch, where the peg rests at the time `now`, s, after a way that shows it; else None."""
        if not self.footing.is_firm(now) or len(self.heights) < LEAST_POINTS:
            return None
        force = np.array(self.forces[::-1])
        # The end is where the hand is, but for the pads, which give way under the force.
        end = np.array(self.heights[::-1]) + SHEAR * force
        # The bottom is where it began to bear the push: the fingers may have slid down the peg since.
        level = (float(np.median(force)) + float(force[0])) / 2.0
        bottom = max(int(np.argmax(force < level)) - 1, 0)
        end, force = end[bottom:], force[bottom:]
        above = np.maximum.accumulate(end - end[0])
        if above[-1] < latch.height + BEFORE / 2:
            return None
        grid = np.arange(FLOOR, min(above[-1], latch.height + BEFORE), GRID)
        return fitted(grid, np.interp(grid, above, force), latch)


def fitted(above: Vector, force: Vector, latch: Latch) -> Signature:
    """Return the latch that explains a curve best, by least absolute deviations: where the hole wedges the peg for some tenths of a
    millimetre the force rises by as much as at the latch, and squares would follow it.

    Args:
        above: Heights above the place where the peg rests, shape (n,), m.
        force: Force at each, shape (n,), N, but for a constant.
        latch: The latch as the recipe states it.
    """
    offsets = np.arange(-latch.height / 2, latch.height / 2 + GRID / 2, GRID)
    shapes = resistance(above[None, :] - offsets[:, None], latch) / latch.force
    weights, rest = np.ones_like(shapes), np.zeros_like(shapes)
    found = np.zeros(len(offsets))
    for _ in range(ROUNDS):
        total = weights.sum(axis=1, keepdims=True)
        swings = shapes - (weights * shapes).sum(axis=1, keepdims=True) / total
        around = force - (weights * force).sum(axis=1, keepdims=True) / total
        found = (weights * swings * around).sum(axis=1) / np.maximum((weights * swings * swings).sum(axis=1), 1e-9)
        rest = np.abs(around - found[:, None] * swings)
        weights = 1.0 / np.maximum(rest, EXACT)
    # A curve that falls where the latch rises is not explained by it.
    best = int(np.argmin(np.where(found > 0.0, rest.sum(axis=1), math.inf)))
    if found[best] <= 0.0:
        return Signature(0.0, 0.0, math.inf)
    swing = float(found[best] * shapes[best].std())
    return Signature(
        float(found[best]), float(offsets[best]), DEVIATION * float(np.median(rest[best])) / max(swing, 1e-9)
    )


def resistance(above: Vector, latch: Latch) -> Vector:
    """Return the force of a latch, N, at heights above the bottom, m, of any shape; the law that `drivers.parts.Latch` states."""
    way = 1.0 - above / latch.height
    curve = np.sin(2.0 * np.pi * way) if latch.kind == "detent" else way
    return np.where((way >= 0.0) & (way <= 1.0), latch.force * curve, 0.0)
