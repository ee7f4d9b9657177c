"""Statistics of success and time: means, quantiles and Wilson intervals; pure."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

Z95 = 1.959963984540054
"""Two-sided 95 % quantile of the normal distribution."""


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


def spread(values: Sequence[float]) -> dict[str, float] | None:
    """Return mean, median and 95th percentile, or None of nothing."""
    if not values:
        return None
    return {
        "mean": float(np.mean(values)),
        "median": float(np.median(values)),
        "p95": float(np.percentile(values, 95)),
        "n": len(values),
    }
