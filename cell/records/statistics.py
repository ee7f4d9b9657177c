"""Statistics of success and time: means, quantiles and Wilson intervals; pure."""

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

Z95 = 1.959963984540054
"""Two-sided 95 % quantile of the normal distribution."""


FEW = {1: 12.706, 2: 4.303, 3: 3.182, 4: 2.776}
"""Student's two-sided 95 % quantiles by degrees of freedom, for few degrees: the expansion of `student` is too coarse there."""


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
    """Return mean, median, 95th percentile and number of values; None without values."""
    if not len(values):
        return None
    found = np.asarray(values)
    median, p95 = np.percentile(found, [50, 95])
    return {"mean": float(found.mean()), "median": float(median), "p95": float(p95), "n": len(values)}
