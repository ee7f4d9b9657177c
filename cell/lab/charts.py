"""Charts of the laboratory: panels of curves, and speed against accuracy; all charts use this palette."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from cell.lab.published import PUBLISHED_TOTAL, StageLine
from cell.records.statistics import wilson

CHART = "speed_accuracy.png"
INK, GREY, BLUE, RED, GREEN, PURPLE = "#222222", "#888888", "#4477aa", "#ee6677", "#228833", "#aa3377"
"""Palette of the charts, with `COLOURS`; colour-blind readers can distinguish it."""


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
    is_band: bool = False
    """True to draw the intervals as a band along the line instead of bars."""
    is_hollow: bool = False
    text: str = ""
    """Text above each point."""


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
    y_names: Sequence[str] = ()


def draw_panels(
    panels: Sequence[Panel],
    title: str,
    path: Path,
    across: int = 0,
    legend: int = 0,
    height: float = 3.9,
    width: float = 4.6,
) -> Path:
    """Draw panels side by side, and return the file.

    Args:
        panels: Panels.
        title: Title of the figure.
        path: File to write.
        across: Number of panels in a row; 0 puts all into one row.
        legend: Number of columns of one legend below all panels; 0 gives each panel its own.
        height: Height of a panel, inches.
        width: Width of a panel, inches.
    """
    across = across or len(panels)
    down = math.ceil(len(panels) / across)
    width = 1.0 + width * across
    figure = Figure(figsize=(width, 1.2 + height * down), layout="constrained")
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
    # A title has 13 letters per inch.
    figure.suptitle("\n".join(fill(line, round(13.0 * width)) for line in title.splitlines()), fontsize=10)
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
    axes.set_title(fill(panel.title, 54), fontsize=10)
    axes.grid(alpha=0.25)
    if has_legend and any(curve.label for curve in panel.curves):
        axes.legend(fontsize=8)


def _draw_curve(axes: Axes, curve: Curve) -> None:
    face = "none" if curve.is_hollow else curve.colour
    if curve.is_band:
        # Where the curve turns back, one polygon would cross itself, so every two points have their own.
        for x, low, high in (np.transpose(two) for two in pairwise(np.array([curve.x, curve.low, curve.high]).T)):
            axes.fill_between(x, low, high, color=curve.colour, alpha=0.15, lw=0.0)
    elif np.size(curve.low):
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
        solid_capstyle="butt",
    )
    if curve.text:
        for at in zip(
            np.ravel(curve.x),
            np.maximum(np.ravel(curve.y), curve.high if np.size(curve.high) else -np.inf),
            strict=True,
        ):
            axes.annotate(curve.text, at, xytext=(0, 8), textcoords="offset points", fontsize=8, ha="center")


def _scale(axes: Axes, panel: Panel) -> None:
    for name, axis, ticks, names, limits in (
        ("x", axes.xaxis, panel.x_ticks, panel.x_names, panel.x_limits),
        ("y", axes.yaxis, panel.y_ticks, panel.y_names, panel.y_limits),
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


def draw_speed_accuracy(line: StageLine, path: Path) -> Path:
    """Draw success with its Wilson 95 % interval against mean total time, for this cell and as published; return the file.

    Args:
        line: Last line of this cell's stage table.
        path: File to write.
    """
    curves = []
    for name, colour, style, each in (
        ("[gibbons], Table I", INK, "s", PUBLISHED_TOTAL),
        ("this cell, simulated", BLUE, "o", line),
    ):
        low, high = wilson(each.successes, each.attempts)
        label = f"{name}: {each.successes}/{each.attempts}, " + (
            "no time" if each.time is None else f"{each.time:.1f} s"
        )
        time, rate = math.nan if each.time is None else each.time, 100.0 * each.successes / max(each.attempts, 1)
        curves.append(Curve([time], [rate], colour, label, style, low=[100.0 * low], high=[100.0 * high]))
    labels = (
        "mean total time of successes: search + insertion + adjustment (s)",
        "success rate (%), Wilson 95 % interval",
    )
    panel = Panel(
        "", *labels, curves, x_limits=(0.0, 1.15 * max(PUBLISHED_TOTAL.time, line.time or 0.0)), y_limits=(0.0, 104.0)
    )
    return draw_panels([panel], "Speed against accuracy", path)
