"""Detect the latch of a hole and the bottom behind it from force against height, over one insertion stroke or several; pure.

    strokes to     profile          unlikelihood                                 told_by
    one bottom --> force at    -->  likelihood of F f((y - s) / h) + c      -->  product over the strokes; its share  --> Signature.doubt
                   each height y    for every force F and height offset s        outside the stated latch

F is the force of the latch, h its height and s its offset from the stated position; f is the shape of its force. The arm's
reported force has an offset of some newtons, which is constant over a few millimetres; the constant c removes it. A leaning
peg rubs on the walls with a force as large as that of the latch, at different heights on each stroke. Rubbing only opposes
the motion. Therefore all strokes count, each weighted by its deviation from the latch.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from drivers.parts import Latch
from drivers.quantities import Vector
from drivers.skin.layout import STIFFEST_SHEAR

BEFORE = 0.0015
"""Length of the stroke above the latch used to measure the force offset, m. Source: chosen, not measured."""
GRID = 1e-4
"""Distance between the heights at which the measured force is compared with the latch's, m. Source: chosen, not measured."""
FLOOR = 2e-4
"""Height above the bottom below which the force is ignored, m, because the bottom already bears the push there. Source: chosen, not measured."""
SHEAR = 1.0 / STIFFEST_SHEAR
"""Compliance of the pads along the fingers, m/N. An error of half its value changes the measured height by 0.1 mm. Source: derived for `STIFFEST_SHEAR`."""
LEAST_POINTS = 8
"""Least number of scans in a stroke; fewer do not show the shape of the force."""
FORCE_SHARE = 0.5
"""Least estimated force of an accepted latch, share of the stated force, fraction; the largest share is the inverse. The value is halfway
between a worn-out latch and the stated one.
"""
PLACE = 0.0005
"""Largest difference between the estimated and the stated height of an accepted latch above the bottom, m: halfway to a bottom that is 1 mm higher. Source: chosen, not measured."""
DOUBT = 1e-3
"""Largest likelihood share of latches with another force or height if the peg counts as seated, fraction. If half of all parts are seated,
one in a thousand parts judged as seated is not. Source: chosen, not measured.
"""
HANGING = 3.5e-4
"""Correlation length of the residual force, m; measured by `cell study seating`, see decision 0022. A leaning peg rubs over some tenths of a
millimetre, so a stroke of 4.3 mm has the weight of twelve independent readings, fewer than its scans.
"""
MOST_FORCE = 3.0
"""Largest considered force of a latch, share of the stated force; it exceeds the largest accepted share, 2, by 1."""
FORCE_STEP = 0.1
"""Step of the considered forces, share of the stated force."""
EXACT = 0.1
"""Least sum a + b of the scales of the residual force, see `unlikelihood`, N: the best resolution of an arm's force. Source: chosen, not measured."""
MOST_WAYS = 64
"""Number of strokes to keep: ten attempts with five strokes each, and some that ended elsewhere. The likelihoods of as many strokes are
cached, because the skill and the success gate evaluate them at every scan of a rest.
"""


@dataclass(frozen=True, slots=True)
class Signature:
    """Estimate of the latch from the insertion strokes of a resting peg."""

    force: float
    """Force of the latch, N."""
    offset: float
    """Height of the latch minus its stated height, m."""
    doubt: float
    """Likelihood share of latches with another force or height than stated, fraction."""

    @property
    def is_sure(self) -> bool:
        """True if the strokes show the stated latch with the bottom at its stated depth."""
        return self.doubt <= DOUBT

    @property
    def is_refuted(self) -> bool:
        """True if the strokes show another latch, or another bottom."""
        return self.doubt >= 1.0 - DOUBT


@dataclass(frozen=True, slots=True)
class InsertionStroke:
    """One insertion stroke down to a rest."""

    heights: tuple[float, ...]
    """Heights of the hand, decreasing, m, base frame."""
    forces: tuple[float, ...]
    """Force on the hand along z at each height, N."""

    def profile(self, latch: Latch) -> tuple[Vector, Vector] | None:
        """Return evenly spaced heights above the bottom, m, and the force at each, N; None if the stroke does not show the latch."""
        if len(self.heights) < LEAST_POINTS:
            return None
        force = np.array(self.forces[::-1])
        # Height of the peg's end: that of the hand, corrected for the shear of the pads, z + SHEAR F.
        end = np.array(self.heights[::-1]) + SHEAR * force
        # The bottom is the height at which the force rises to half the push; later the fingers can have slid down the peg.
        level = (float(np.median(force)) + float(force[0])) / 2.0
        bottom = max(int(np.argmax(force < level)) - 1, 0)
        end, force = end[bottom:], force[bottom:]
        above = np.maximum.accumulate(end - end[0])
        if above[-1] < latch.height + BEFORE / 2:
            return None
        grid = np.arange(FLOOR, min(above[-1], latch.height + BEFORE), GRID)
        return grid, np.interp(grid, above, force)


def told_by(ways: Sequence[InsertionStroke], latch: Latch) -> Signature:
    """Return the estimate of the latch from several strokes to one bottom; strokes that do not show the latch are ignored.

    The likelihoods of the strokes, which are independent, are multiplied for every force and height. A stroke with rubbing
    therefore adds little information and removes none. The share of unseated parts among those judged as seated stays below
    `DOUBT` for any number of strokes.
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
    """Return the considered latches: forces as shares of the stated one, shape (n, 1), and height offsets, shape (1, m), m."""
    shares = FORCE_STEP * np.arange(round(MOST_FORCE / FORCE_STEP) + 1, dtype=np.float64)
    # For a low latch, the range must still include a bottom that is clearly at another height: at least 3 PLACE.
    most = round(max(latch.height / 2, 3.0 * PLACE) / GRID)
    return shares[:, None], GRID * np.arange(-most, most + 1, dtype=np.float64)[None, :]


@lru_cache(maxsize=MOST_WAYS)
def unlikelihood(way: InsertionStroke, latch: Latch) -> Vector | None:
    """Return the negative log likelihood of every considered force and height of the latch, up to a constant, shape (n, m).

    A wall only opposes the motion of a rubbing peg. The residual r of the force therefore has a scale b above the latch's
    curve and a scale a <= b below it: the density is exp(-r / b) / (a + b) for r > 0 and exp(r / a) / (a + b) for r < 0.
    At the maximum of the likelihood, a + b = (sqrt(p) + sqrt(m))²; p is the mean of the positive part of r, and m the mean
    of its negative part. For n independent residuals the likelihood is (sqrt(p) + sqrt(m)) ** (-2 n). If a = b, this is the
    law of least absolute deviations. At the maximum over the constant c, c equals one of the residuals.

    The result is None if the stroke does not show the latch.
    """
    profile = way.profile(latch)
    if profile is None:
        return None
    above, force = profile
    shares, offsets = considered(latch)
    shapes = resistance(above[None, :] - offsets.T, latch)
    rest = np.sort(force - shares[:, :, None] * shapes[None], axis=2)
    sums, count = np.cumsum(rest, axis=2), len(above)
    # Candidate c = k-th residual: m = (k r_k - sum_{i <= k} r_i) / n, p = (sum_{i > k} r_i - (n - k) r_k) / n
    number = np.arange(1, count + 1)
    less = (number * rest - sums) / count
    more = (sums[:, :, -1:] - sums - (count - number) * rest) / count
    sizes = (np.sqrt(np.maximum(less, EXACT / 4)) + np.sqrt(np.maximum(more, EXACT / 4))) ** 2
    # At most half of the residuals lie below c, because a <= b.
    table = count * GRID / HANGING * np.log(sizes[:, :, : (count + 1) // 2].min(axis=2))
    table.setflags(write=False)
    return np.asarray(table)


def resistance(above: Vector, latch: Latch) -> Vector:
    """Return the force of a latch, N, at heights above the bottom, m, of any shape, by the law of `drivers.parts.Latch`."""
    # u = 1 - y / h, 0 <= u <= 1: F sin(2 pi u) for a detent, else F u
    way = 1.0 - above / latch.height
    curve = np.sin(2.0 * np.pi * way) if latch.kind == "detent" else way
    return np.where((way >= 0.0) & (way <= 1.0), latch.force * curve, 0.0)
