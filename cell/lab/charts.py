"""The chart of speed against accuracy."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from matplotlib.figure import Figure

from cell.lab.published import PUBLISHED_ATTEMPTS, PUBLISHED_SUCCESSES, PUBLISHED_TOTAL, StageLine
from cell.plots import COLOURS
from cell.statistics import wilson

CHART = "speed_accuracy.png"


@dataclass(frozen=True, slots=True)
class Point:
    """One way of working, on the chart of speed against accuracy."""

    label: str
    successes: int
    attempts: int
    time: float
    """Mean total time of the successes, s."""

    @classmethod
    def of_total(cls, line: StageLine) -> Self:
        """Return this cell's point, from the last line of its stage table."""
        time = math.nan if line.time is None else line.time
        return cls("this cell, simulated", line.successes, line.attempts, time)


def plot_speed_accuracy(points: Sequence[Point], path: Path) -> None:
    """Draw success rate, with its Wilson 95 % interval, against mean total time, with the published point."""
    figure = Figure(figsize=(7.5, 5), layout="constrained")
    axes = figure.add_subplot()
    published = Point("[gibbons], Table I", PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS, PUBLISHED_TOTAL)
    longest = PUBLISHED_TOTAL
    for point, colour, marker in zip((published, *points), ("#222222", *COLOURS[1:]), "sovD^<>", strict=False):
        if not math.isfinite(point.time):
            axes.plot([], [], marker, color=colour, label=f"{point.label}: {point.successes}/{point.attempts}, no time")
            continue
        low, high = wilson(point.successes, point.attempts)
        rate = point.successes / point.attempts
        label = f"{point.label}: {point.successes}/{point.attempts}, {point.time:.1f} s"
        error = [[100 * (rate - low)], [100 * (high - rate)]]
        axes.errorbar([point.time], [100 * rate], yerr=error, fmt=marker, color=colour, capsize=4, label=label)
        longest = max(longest, point.time)
    axes.set_xlim(0.0, 1.15 * longest)
    axes.set_ylim(0.0, 104.0)
    axes.set_xlabel("mean total time of successes: search + insertion + adjustment (s)")
    axes.set_ylabel("success rate (%), Wilson 95 % interval")
    axes.set_title("Speed against accuracy")
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right", fontsize=9)
    figure.savefig(path, dpi=110)
