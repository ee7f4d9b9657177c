"""Charts of the laboratory: speed against accuracy, panels of curves, and rows of results."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from cell.film.plots import COLOURS
from cell.lab.published import PUBLISHED_ATTEMPTS, PUBLISHED_SUCCESSES, PUBLISHED_TOTAL, StageLine
from cell.records.statistics import wilson

CHART = "speed_accuracy.png"
INK, GREY, BLUE, RED, GREEN, PURPLE = "#222222", "#888888", "#4477aa", "#ee6677", "#228833", "#aa3377"
"""Palette of the charts, with `COLOURS`; colour-blind readers can distinguish it."""
LETTERS_PER_INCH = 13.0
"""Length of a line of a title."""


@dataclass(frozen=True, slots=True)
class ChartPoint:
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


def plot_speed_accuracy(points: Sequence[ChartPoint], path: Path) -> None:
    """Draw success rate, with its Wilson 95 % interval, against mean total time, with the published point."""
    figure = Figure(figsize=(7.5, 5), layout="constrained")
    axes = figure.add_subplot()
    published = ChartPoint("[gibbons], Table I", PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS, PUBLISHED_TOTAL)
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
class Curve:
    """Points, or a line through them."""

    x: ArrayLike
    y: ArrayLike
    colour: str = INK
    label: str = ""
    style: str = "-"
    """Line style or marker, as Matplotlib's format."""
    size: float = 1.5
    """Width of the line, or size of the markers, points."""
    alpha: float = 1.0
    low: ArrayLike = ()
    """Lower ends of the points' intervals; empty if there are none."""
    high: ArrayLike = ()
    is_hollow: bool = False


@dataclass(frozen=True, slots=True)
class Panel:
    """Curves over common axes."""

    title: str
    x: str
    """Label of the axis."""
    y: str
    curves: Sequence[Curve]
    log: str = ""
    """Axes with a logarithmic scale: "x", "y", "xy" or ""."""
    x_ticks: Sequence[float] = ()
    y_ticks: Sequence[float] = ()
    x_limits: tuple[float | None, float | None] = (None, None)
    y_limits: tuple[float | None, float | None] = (None, None)
    marks: Sequence[float] = ()
    """Positions of vertical dashed lines."""
    x_names: Sequence[str] = ()
    """Names of the ticks instead of their values."""


def draw_panels(panels: Sequence[Panel], title: str, path: Path, across: int = 0, legend: int = 0) -> Path:
    """Draw panels side by side, and return the file.

    Args:
        panels: Panels.
        title: Title of the figure.
        path: File to write.
        across: Number of panels in a row; 0 puts all into one row.
        legend: Number of columns of one legend below all panels; 0 gives each panel its own.
    """
    across = across or len(panels)
    down = math.ceil(len(panels) / across)
    width = 1.0 + 4.6 * across
    figure = Figure(figsize=(width, 1.2 + 3.9 * down), layout="constrained")
    grid = figure.subplots(down, across, squeeze=False).ravel()
    for axes, panel in zip(grid, panels, strict=False):
        _draw_panel(axes, panel, has_legend=not legend)
    for axes in grid[len(panels) :]:
        axes.remove()
    if legend:
        found = {
            label: handle
            for axes in figure.axes
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        figure.legend(found.values(), found.keys(), loc="outside lower center", ncols=legend, fontsize=8, frameon=False)
    figure.suptitle("\n".join(fill(line, round(LETTERS_PER_INCH * width)) for line in title.splitlines()), fontsize=10)
    figure.savefig(path, dpi=110)
    return path


def _draw_panel(axes: Axes, panel: Panel, has_legend: bool) -> None:
    for curve in panel.curves:
        _draw_curve(axes, curve)
    for place in panel.marks:
        axes.axvline(place, color=GREY, ls="--", lw=0.8)
    _scale(axes, panel)
    axes.set_xlabel(panel.x)
    axes.set_ylabel(panel.y)
    axes.set_title(panel.title, fontsize=10)
    axes.grid(alpha=0.25)
    if has_legend and any(curve.label for curve in panel.curves):
        axes.legend(fontsize=8)


def _draw_curve(axes: Axes, curve: Curve) -> None:
    face = "none" if curve.is_hollow else curve.colour
    if np.size(curve.low):
        y = np.array(curve.y)
        bars = [np.maximum(y - np.array(curve.low), 0.0), np.maximum(np.array(curve.high) - y, 0.0)]
        axes.errorbar(curve.x, y, yerr=bars, fmt="none", ecolor=curve.colour, elinewidth=0.9, capsize=3, alpha=0.7)
    axes.plot(
        curve.x,
        curve.y,
        curve.style,
        color=curve.colour,
        label=curve.label or None,
        lw=curve.size,
        ms=4 * curve.size,
        alpha=curve.alpha,
        mfc=face,
    )


def _scale(axes: Axes, panel: Panel) -> None:
    for name, axis, ticks, names, limits in (
        ("x", axes.xaxis, panel.x_ticks, panel.x_names, panel.x_limits),
        ("y", axes.yaxis, panel.y_ticks, (), panel.y_limits),
    ):
        if name in panel.log:
            getattr(axes, f"set_{name}scale")("log")
        if limits != (None, None):
            getattr(axes, f"set_{name}lim")(*limits)
        if len(ticks):
            low, high = getattr(axes, f"get_{name}lim")()
            shown = [tick for tick in ticks if low <= tick <= high]
            axis.set_ticks(shown, names or [f"{tick:g}" for tick in shown])
            axis.set_ticks([], minor=True)


@dataclass(frozen=True, slots=True)
class Bar:
    """Success, time and force of trials, on one row of a chart."""

    row: str
    """Name of the row."""
    series: str
    """Name in the legend; its colour is common to all rows."""
    successes: int
    trials: int
    time: float
    """Mean time of the successes, s."""
    time_error: float
    """Half the 95 % interval of that mean, s."""
    force: float
    """Median of the largest contact force, N."""
    force_p95: float


def _values(bars: Sequence[Bar]) -> tuple[tuple[ArrayLike, ArrayLike], ...]:
    """Return success, %, mean time, s, and force, N, of bars with trials, each with its intervals."""
    rates = np.array([100 * bar.successes / bar.trials for bar in bars])
    bounds = 100 * np.array([wilson(bar.successes, bar.trials) for bar in bars]).reshape(-1, 2).T
    return (
        (rates, np.maximum([rates - bounds[0], bounds[1] - rates], 0.0)),
        ([bar.time for bar in bars], [bar.time_error for bar in bars]),
        ([bar.force for bar in bars], [[0.0] * len(bars), [bar.force_p95 - bar.force for bar in bars]]),
    )


def draw_rows(bars: Sequence[Bar], title: str, path: Path) -> Path:
    """Draw success with its Wilson interval, mean time, and force, a row for each name; return the file."""
    rows, series = list(dict.fromkeys(bar.row for bar in bars)), list(dict.fromkeys(bar.series for bar in bars))
    figure = Figure(figsize=(12.5, 2.2 + 0.34 * len(rows)), layout="constrained")
    panels = figure.subplots(1, 3, sharey=True)
    for number, name in enumerate(series):
        of = [bar for bar in bars if bar.series == name and bar.trials]
        heights = [0.16 * (number - (len(series) - 1) / 2) - rows.index(bar.row) for bar in of]
        for axes, (x, error) in zip(panels, _values(of), strict=True):
            colour = COLOURS[number % len(COLOURS)]
            axes.errorbar(x, heights, xerr=error, fmt="o", markersize=4, color=colour, label=name)
    panels[0].set_yticks(-np.arange(len(rows)), rows, fontsize=8)
    panels[0].set_xlim(0.0, 102.0)
    labels = (
        "success (%), Wilson 95 % interval",
        "mean total time of successes (s), 95 % interval",
        "largest contact force (N): median to p95",
    )
    for axes, label in zip(panels, labels, strict=True):
        axes.set_xlabel(label)
        axes.grid(alpha=0.3)
    panels[2].legend(loc="lower right", fontsize=8)
    figure.suptitle(title, fontsize=9)
    figure.savefig(path, dpi=110)
    return path
