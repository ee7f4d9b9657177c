"""How well and how fast: counts, Wilson intervals, and the stage table beside the published one; pure."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

Z95 = 1.959963984540054
"""Two-sided 95 % quantile of the normal distribution."""


@dataclass(frozen=True, slots=True)
class PublishedStage:
    """One row of [gibbons], Table I."""

    name: str
    label: str
    successes: int
    attempts: int
    time: float
    """Mean, s."""


PUBLISHED: tuple[PublishedStage, ...] = (
    PublishedStage("spray_search", "search", 39, 40, 19.9),
    PublishedStage("tactile_insert", "insertion", 38, 39, 24.1),
    PublishedStage("spiral_adjust", "adjustment", 38, 38, 10.1),
)
PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS, PUBLISHED_TOTAL = 38, 40, 54.1


@dataclass(frozen=True, slots=True)
class StageLine:
    """One row of the table: this cell's figures for one stage."""

    name: str
    successes: int
    attempts: int
    time: float | None
    """Mean over its successes, s; None where there are none."""


@dataclass(frozen=True, slots=True)
class Tried:
    """One trial, as far as the table needs it."""

    succeeded: bool
    stage: str
    """Skill that was reached last."""
    times: dict[str, float]
    """Time of each of the published stages that was reached, s."""


def wilson(successes: int, attempts: int, z: float = Z95) -> tuple[float, float]:
    """Return the Wilson score interval of a success rate, [wilson], by default at 95 %.

    Args:
        successes: How many succeeded.
        attempts: Of how many; with none, the interval is 0 to 1.
        z: Quantile of the normal distribution.
    """
    if attempts == 0:
        return 0.0, 1.0
    share, n = successes / attempts, attempts
    middle = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    # Rounding may leave the rate itself just outside, where all or none succeeded.
    return max(min(middle - half, share), 0.0), min(max(middle + half, share), 1.0)


def stage_table(trials: Sequence[Tried]) -> list[StageLine]:
    """Return attempts, successes and mean time of every published stage, and of the whole, in that order.

    A stage was attempted when it has a time, and succeeded when the trial went on to another stage or succeeded.
    """
    lines = []
    for stage in PUBLISHED:
        tried = [trial for trial in trials if stage.name in trial.times]
        good = [trial.times[stage.name] for trial in tried if trial.succeeded or trial.stage != stage.name]
        lines.append(StageLine(stage.name, len(good), len(tried), mean(good)))
    totals = [sum(trial.times.values()) for trial in trials if trial.succeeded]
    return [*lines, StageLine("total", len(totals), len(trials), mean(totals))]


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
