"""Tell the latch of a hole and the bottom behind it by force against height, felt on one way down or on several; pure.

    ways of a peg      profile         likelihood of every force F and place s        told_by
    to one bottom  -->  force at  -->  that F f((y - s) / h) + c explains it, y  -->  product over the ways; share of it  -->  Signature.doubt
                        each height    above the bottom, by `unlikelihood`             where no latch as stated lies

What the arm reports as a force errs by some newtons that stay as they are over a few millimetres; the constant c takes them out. A peg that leans rubs
at the walls by as much as the latch resists, at other heights on each way, and is only held back by them; that is why all ways count, each by
how far it deviates from the latch.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from drivers.parts import Latch
from drivers.quantities import Vector

BEFORE = 0.0015
"""Way above the latch that tells what the arm reports where nothing resists, m."""
GRID = 1e-4
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
DOUBT = 1e-3
"""Largest share of the likelihood that a latch with another force or place may have, fraction: of as many parts as are seated and are not, each
known no better than that, one in a thousand of those that are told is none.
"""
HANGING = 3.5e-4
"""Way over which the deviations of a curve from its latch hang together, m; measured by `cell study seating`, see decision 0022: a leaning peg rubs
for some tenths of a millimetre, so that a way of 4.3 mm has the weight of twelve independent readings and not that of its scans.
"""
MOST_FORCE = 3.0
"""Largest force of a latch that is considered, as a share of the stated one: beyond what a latch as stated can have by as much as that has itself."""
FORCE_STEP = 0.1
"""Distance between the forces that are considered, as a share of the stated one."""
EXACT = 0.1
"""Least sum of the sizes of a curve's deviations up and down, N; no arm reports a force better."""
REMEMBERED = 64
"""Number of ways whose likelihoods are remembered, so that skill and gate do not reckon them at every scan of a rest."""


@dataclass(frozen=True, slots=True)
class Signature:
    """What the curve of a part that rests says of its latch."""

    force: float
    """Force of the latch, N."""
    offset: float
    """Height of the latch over the stated one, m."""
    doubt: float
    """Share of the likelihood that a latch with another force or at another place has, fraction."""

    @property
    def is_sure(self) -> bool:
        """Whether this is the latch as the recipe states it, with the bottom where it should be."""
        return self.doubt <= DOUBT

    @property
    def is_refuted(self) -> bool:
        """Whether this is surely another latch, or another bottom."""
        return self.doubt >= 1.0 - DOUBT


@dataclass(frozen=True, slots=True)
class Way:
    """One way down to where something bears the peg."""

    heights: tuple[float, ...]
    """Heights of the hand, falling, m, base frame."""
    forces: tuple[float, ...]
    """Force on the hand along z at each, N."""

    def profile(self, latch: Latch) -> tuple[Vector, Vector] | None:
        """Return heights above the bottom, m, at even distances, and the force at each, N; None of a way that does not show the latch."""
        if len(self.heights) < LEAST_POINTS:
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
        return grid, np.interp(grid, above, force)


def told_by(ways: Sequence[Way], latch: Latch) -> Signature:
    """Return what several ways down to one bottom say of its latch together; those that do not show it count for nothing.

    The likelihoods of independent ways multiply, for every force and place before one is chosen: a way on which the peg rubbed tells little,
    and takes nothing from one that went smoothly. Of parts that are not seated no more than `DOUBT` are ever told, however often one looks.
    """
    tables = [table for way in ways if (table := unlikelihood(way, latch)) is not None]
    shares, offsets = considered(latch)
    total = np.sum(tables, axis=0) if tables else np.zeros((shares.size, offsets.size))
    likely = np.exp(total.min() - total)
    is_stated = (np.abs(offsets) <= PLACE + GRID / 2) & (shares >= FORCE_SHARE) & (shares <= 1.0 / FORCE_SHARE)
    force, offset = np.unravel_index(int(total.argmin()), total.shape)
    doubt = min(float(likely[~is_stated].sum() / likely.sum()), 1.0)
    return Signature(float(shares[force, 0]) * latch.force, float(offsets[0, offset]), doubt)


def considered(latch: Latch) -> tuple[Vector, Vector]:
    """Return the forces of a latch that are considered, as shares of the stated one, shape (n, 1), and its heights over the stated one,
    shape (1, m), m.
    """
    shares = FORCE_STEP * np.arange(round(MOST_FORCE / FORCE_STEP) + 1, dtype=np.float64)
    # A bottom that is far enough off to be told must be among them where the latch is low.
    most = round(max(latch.height / 2, 3.0 * PLACE) / GRID)
    return shares[:, None], GRID * np.arange(-most, most + 1, dtype=np.float64)[None, :]


@lru_cache(maxsize=REMEMBERED)
def unlikelihood(way: Way, latch: Latch) -> Vector | None:
    """Return the negative logarithm of the likelihood of every force and place of the latch that are considered, but for a constant,
    shape (n, m); None for a way that does not show it.

    A wall that a peg rubs at only holds it back. Deviations upwards are therefore as large as they are on this way, b, and those downwards have
    a size a of their own, at most b: the density is exp(-r / b) / (a + b) above the latch and exp(r / a) / (a + b) below it. Where the likelihood is
    largest, the mean p of what is above and the mean m of what is below give a + b = (sqrt(p) + sqrt(m))², so that n independent ones
    have (sqrt(p) + sqrt(m)) ** (-2 n); for a = b it is the law of least absolute deviations. The constant c is one of the deviations
    themselves, since it is largest there.
    """
    profile = way.profile(latch)
    if profile is None:
        return None
    above, force = profile
    shares, offsets = considered(latch)
    shapes = resistance(above[None, :] - offsets.T, latch)
    rest = np.sort(force - shares[:, :, None] * shapes[None], axis=2)
    sums, count = np.cumsum(rest, axis=2), len(above)
    number = np.arange(1, count + 1)
    less = (number * rest - sums) / count
    more = (sums[:, :, -1:] - sums - (count - number) * rest) / count
    sizes = (np.sqrt(np.maximum(less, EXACT / 4)) + np.sqrt(np.maximum(more, EXACT / 4))) ** 2
    # No more of the curve lies below the latch than above it.
    table = count * GRID / HANGING * np.log(sizes[:, :, : (count + 1) // 2].min(axis=2))
    table.setflags(write=False)
    return np.asarray(table)


def resistance(above: Vector, latch: Latch) -> Vector:
    """Return the force of a latch, N, at heights above the bottom, m, of any shape; the law that `drivers.parts.Latch` states."""
    way = 1.0 - above / latch.height
    curve = np.sin(2.0 * np.pi * way) if latch.kind == "detent" else way
    return np.where((way >= 0.0) & (way <= 1.0), latch.force * curve, 0.0)
