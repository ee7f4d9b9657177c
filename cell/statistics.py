"""Statistics of success and time: means, quantiles, Wilson intervals and sequential tests; pure."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

Z95 = 1.959963984540054
"""Two-sided 95 % quantile of the normal distribution."""


FEW = {1: 12.706, 2: 4.303, 3: 3.182, 4: 2.776}
"""Student's quantiles that belong to 95 % where the expansion is too coarse, by degrees of freedom."""


def student(freedom: int) -> float:
    """Return Student's quantile that belongs to 95 %, within 1 %: from 5 degrees of freedom on by its expansion in their inverse."""
    z = Z95
    return FEW.get(freedom) or z + (z**3 + z) / (4 * freedom) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * freedom**2)


def wilson(successes: int, attempts: int, z: float = Z95) -> tuple[float, float]:
    """Return the Wilson score interval of a success rate, [wilson], by default at 95 %.

    Args:
        successes: Number of successes.
        attempts: Number of attempts; with none, the interval is 0 to 1.
        z: Quantile of the normal distribution.
    """
    if attempts == 0:
        return 0.0, 1.0
    share, n = successes / attempts, attempts
    middle = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    # Where all or none succeeded, rounding may leave the rate itself just outside the interval.
    return max(min(middle - half, share), 0.0), min(max(middle + half, share), 1.0)


def mean(values: Iterable[float]) -> float | None:
    """Return the mean, or None of nothing."""
    values = list(values)
    return math.fsum(values) / len(values) if values else None


def spread(values: Sequence[float] | NDArray[np.float64]) -> dict[str, float] | None:
    """Return mean, median and 95th percentile, or None of nothing."""
    if not len(values):
        return None
    median, p95 = np.percentile(found := np.asarray(values), [50, 95])
    return {"mean": float(found.mean()), "median": float(median), "p95": float(p95), "n": len(values)}


class Verdict(StrEnum):
    """Answer of a sequential test."""

    GOOD = "good"
    BAD = "bad"
    OPEN = "undecided"


@dataclass(frozen=True, slots=True)
class RateTest:
    """Sequential probability ratio test between two shares of lost trials, [wald].

    A setting that loses the share `good` is called bad, and one that loses the share `bad` is called good, with at most about
    the probability `error` each; what lies between may be called either. Wilson intervals that are taken where the test
    ends hold the true share less often than those of a fixed number of trials: [siegmund].
    """

    good: float
    """Share of lost trials of a setting that is good, above 0."""
    bad: float
    """Share of lost trials of a setting that is bad, above `good` and below 1."""
    error: float = 0.05
    """Probability of each wrong answer."""
    least: int = 1
    """Least number of trials before it answers, so that there is an interval worth showing."""

    def verdict(self, lost: int, trials: int) -> Verdict:
        """Return the answer after so many trials."""
        if trials < self.least:
            return Verdict.OPEN
        kept = (trials - lost) * math.log((1.0 - self.bad) / (1.0 - self.good))
        ratio = lost * math.log(self.bad / self.good) + kept
        bound = math.log((1.0 - self.error) / self.error)
        if abs(ratio) < bound:
            return Verdict.OPEN
        return Verdict.BAD if ratio > 0.0 else Verdict.GOOD
