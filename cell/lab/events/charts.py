"""Charts of the study of hole events: detection and delay against false events."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cell.lab.events.measure import HEIGHT, SKIN, Watched, rice_limit
from cell.lab.events.report import NAMES, RATES, EventLine, EventStudy
from cell.records.statistics import wilson
from skills.search.params import SpraySearchParams

CHART = "events.png"
INK, GREY = "#222222", "#bbbbbb"
STYLES = {HEIGHT: ("#4477aa", "o"), SKIN: ("#ccbb44", "v")}


def draw(found: EventStudy, search: SpraySearchParams, path: Path) -> None:
    """Draw detection and delay against false events, and the false dips against the prediction from the height's spread."""
    figure = Figure(figsize=(14.0, 5.6), layout="constrained")
    seen, late, told = figure.subplots(1, 3)
    handles = []
    for detector, (colour, marker) in STYLES.items():
        lines = sorted(
            (line for line in found.lines if line.detector == detector),
            key=lambda line: (line.stopped, -line.threshold),
        )
        _curves(seen, late, lines, colour, marker)
        handles += seen.plot([], [], marker, color=colour, label=NAMES[detector])
    handles += seen.plot([], [], "o", ms=12, mfc="none", mec=INK, ls="none", label="threshold in use")
    handles += seen.plot(
        [], [], "o", ms=6, mfc="none", mec=INK, ls="none", label="hollow: none seen; bar to upper bound"
    )
    for axes in (seen, late):
        axes.set_xscale("log")
        axes.set_xlabel("searches stopped by a false event, of 1,000\n(Wilson 95 % interval)")
        axes.grid(alpha=0.25)
    seen.set_ylim(-3.0, 103.0)
    seen.set_ylabel("falls detected (%), Wilson 95 % interval")
    seen.set_title("what is seen", fontsize=11)
    late.set_ylim(bottom=0.0)
    late.set_ylabel("from fall to event (s): median, bar to the 95th percentile")
    late.set_title("how soon", fontsize=11)
    _stated(told, found.empty, search)
    figure.legend(handles=handles, loc="outside lower center", ncols=6, fontsize=8.5, frameon=False)
    figure.suptitle(f"Hole events: false alarms against detection and delay\n{found.title}", fontsize=10)
    figure.savefig(path, dpi=150)


def _curves(seen: Axes, late: Axes, lines: Sequence[EventLine], colour: str, marker: str) -> None:
    places = [_place(line) for line in lines]
    shares = [100.0 * line.detected / max(line.falls - line.early, 1) for line in lines]
    kept = [n for n, line in enumerate(lines) if line.falls > line.early]
    seen.plot([places[n] for n in kept], [shares[n] for n in kept], "-", color=colour, lw=1.0, alpha=0.6)
    for n in kept:
        line = lines[n]
        spread: dict[str, Any] = {"xerr": [[places[n] - min(1e3 * line.low, places[n])], [1e3 * line.high - places[n]]]}
        style: dict[str, Any] = {"color": colour, "lw": 0.7, "fmt": "none", "alpha": 0.55}
        bars = [[shares[n] - 100.0 * line.detected_low], [100.0 * line.detected_high - shares[n]]]
        if line.stopped:
            spread["xerr"][0][0] = places[n] - 1e3 * line.low
        seen.errorbar([places[n]], [shares[n]], yerr=np.maximum(bars, 0.0), **spread, **style)
        look: dict[str, Any] = {"ms": 5, "color": colour, "mfc": colour if line.stopped else "white", "ls": "none"}
        seen.plot([places[n]], [shares[n]], marker, **look)
        if math.isfinite(line.delay):
            late.errorbar([places[n]], [line.delay], yerr=[[0.0], [line.delay_p95 - line.delay]], **style)
            late.plot([places[n]], [line.delay], marker, **look)
        if line.in_use:
            seen.plot([places[n]], [shares[n]], "o", ms=12, mfc="none", mec=INK, ls="none", zorder=5)
            late.plot([places[n]], [line.delay], "o", ms=12, mfc="none", mec=INK, ls="none", zorder=5)


def _place(line: EventLine) -> float:
    """Return the position of a line on the axis of false events in 1,000 searches; zero events are drawn at 0.5."""
    return 1e3 * max(line.stopped, 0.5) / line.searches


def _stated(axes: Axes, empty: Sequence[Watched], search: SpraySearchParams) -> None:
    """Draw the share of searches stopped by a dip, for thresholds from the spread of the height."""
    colour, marker = STYLES[HEIGHT]
    for rate in RATES:
        stopped = sum(row.before[HEIGHT].largest > rice_limit(row, rate, search.timeout) for row in empty if row.slid)
        low, high = wilson(stopped, len(empty))
        place = 1e3 * max(stopped, 0.5) / len(empty)
        axes.errorbar(
            [rate],
            [place],
            yerr=[[max(place - 1e3 * low, 0.0) if stopped else 0.0], [1e3 * high - place]],
            fmt=marker,
            ms=5,
            color=colour,
            mfc=colour if stopped else "white",
            lw=0.8,
        )
    axes.plot(RATES, [-1e3 * math.expm1(-rate) for rate in RATES], "--", color=GREY, lw=1.2)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("false alarms stated, a search\n(dashes: as stated)")
    axes.set_ylabel("searches stopped by a false event, of 1,000")
    axes.set_title("height: as its own spread states?", fontsize=11)
    axes.grid(alpha=0.25)
