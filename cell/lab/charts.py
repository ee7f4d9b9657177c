"""Charts of several commands: speed against accuracy, and labels that overlap neither each other nor a point."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from cell.film.plots import COLOURS
from cell.lab.published import PUBLISHED_ATTEMPTS, PUBLISHED_SUCCESSES, PUBLISHED_TOTAL, StageLine
from cell.records.statistics import wilson

CHART = "speed_accuracy.png"
OFFSETS = (12, 26, 42, 60, 80, 102, 126, 152)
"""Distances from its point that a label tries, points; beyond the first a thin line leads to it."""
SIDES = ((1, 0), (-1, 0), (1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (2, 1), (-2, 1), (2, -1), (-2, -1))
"""Directions that a label tries, in order."""
LETTERS = 9.0
"""Size of the letters, points."""
CLEAR = 6.0
"""Half the side of the square around a point, pixels."""


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


@dataclass(frozen=True, slots=True)
class Label:
    """Label of a point, at the point's position on both axes."""

    x: float
    y: float
    text: str
    is_bold: bool = False


def place_labels(figure: Figure, axes: Axes, labels: Sequence[Label]) -> None:
    """Write every label at the first free position around its point; if none is free, at the last position tried."""
    figure.draw_without_rendering()
    frame = axes.get_window_extent()
    spots = [axes.transData.transform((label.x, label.y)) for label in labels]
    taken = [Bbox.from_extents(x - CLEAR, y - CLEAR, x + CLEAR, y + CLEAR) for x, y in spots]
    for label in labels:
        for step in OFFSETS:
            if any(_written(axes, label, (across * step, up * step), taken, frame) for across, up in SIDES):
                break
        else:
            _written(axes, label, (OFFSETS[0], 0), [], frame)


def _written(axes: Axes, label: Label, offset: tuple[float, float], taken: list[Bbox], frame: Bbox) -> bool:
    """Write a label at an offset from its point, points, if the position is free; return True if it was written."""
    side = "left" if offset[0] > 0 else "right" if offset[0] < 0 else "center"
    note = axes.annotate(
        label.text,
        (label.x, label.y),
        xytext=offset,
        textcoords="offset points",
        ha=side,
        va="center",
        fontsize=LETTERS,
        fontweight="bold" if label.is_bold else "normal",
        bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.75},
        zorder=6,
    )
    text = note.get_window_extent()
    is_inside = frame.x0 <= text.x0 and text.x1 <= frame.x1 and frame.y0 <= text.y0 and text.y1 <= frame.y1
    if not is_inside or text.count_overlaps(taken):
        note.remove()
        return False
    taken.append(text)
    if max(map(abs, offset)) > OFFSETS[0]:
        line = {"arrowstyle": "-", "lw": 0.5, "color": "#777777", "shrinkA": 0, "shrinkB": 4}
        axes.annotate(
            "", (label.x, label.y), xytext=offset, textcoords="offset points", ha=side, va="center", arrowprops=line
        )
    return True
