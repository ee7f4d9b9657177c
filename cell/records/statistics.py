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
"""Student's two-sided 95 % quantiles for few degrees of freedom, where the expansion of `student` is too coarse."""


def student(freedom: int) -> float:
    """Return Student's two-sided 95 % quantile within 1 %; from 5 degrees on by an expansion in 1/`freedom`."""
    z = Z95
    return FEW.get(freedom) or z + (z**3 + z) / (4 * freedom) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * freedom**2)


def wilson(successes: int, attempts: int) -> tuple[float, float]:
    """Return the Wilson score interval of a success rate, [wilson], at 95 %; without attempts, it is 0 to 1."""
    if attempts == 0:
        return 0.0, 1.0
    share, n, z = successes / attempts, attempts, Z95
    middle = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    # If all or none succeeded, rounding can leave the rate itself just outside the interval.
    return max(min(middle - half, share), 0.0), min(max(middle + half, share), 1.0)


def mean(values: Iterable[float]) -> float | None:
    """Return the mean; None without values."""
    values = list(values)
    return math.fsum(values) / len(values) if values else None


def spread(values: Sequence[float] | NDArray[np.float64]) -> dict[str, float] | None:
    """Return mean, median and 95th percentile; None without values."""
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

    If a setting loses the share `good`, the test calls it bad with probability `error` at most, approximately; and the
    reverse for `bad`. Between the two shares, either answer is possible. Wilson intervals at the end of the test contain
    the true share less often than those of a fixed number of trials: [siegmund].
    """

    good: float
    """Share of lost trials of a good setting, above 0."""
    bad: float
    """Share of lost trials of a bad setting, above `good` and below 1."""
    error: float = 0.05
    """Probability of each wrong answer."""
    least: int = 1
    """Least number of trials before an answer, so that the interval is not too wide."""

    def verdict(self, lost: int, trials: int) -> Verdict:
        """Return the answer after `trials` trials with `lost` lost ones."""
        if trials < self.least:
            return Verdict.OPEN
        kept = (trials - lost) * math.log((1.0 - self.bad) / (1.0 - self.good))
        ratio = lost * math.log(self.bad / self.good) + kept
        bound = math.log((1.0 - self.error) / self.error)
        if abs(ratio) < bound:
            return Verdict.OPEN
        return Verdict.BAD if ratio > 0.0 else Verdict.GOOD
