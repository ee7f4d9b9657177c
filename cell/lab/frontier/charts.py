"""Charts of the frontier: success rate against time of every variant, and the way from the paper's method to the shipped one."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cell.lab.frontier.measure import CHAIN, FRONTIER, PRESET, FrontierLine
from cell.lab.published import PUBLISHED, PUBLISHED_ATTEMPTS, PUBLISHED_SUCCESSES, PUBLISHED_TOTAL
from cell.statistics import wilson

INK, GREY = "#222222", "#bbbbbb"
COLOURS = ("#4477aa", "#ee6677", "#228833", "#aa3377", "#66ccee", "#ccbb44")
MARKERS = "osD^vP"
"""Markers of a panel's variants, in order; colour-blind readers can tell them apart."""
STAGES = dict(zip(("search", "insert", "adjust"), ("#66ccee", "#228833", "#ccbb44"), strict=True))
PAPER = "[gibbons], Table I"
SHORTEST = 10.0
"""Latest beginning of the time axis, s."""
RATES = (0, 20, 40, 60, 70, 80, 90, 95, 100)
"""Ticks of the success rate, %."""
TICKS = (2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 40, 60, 80, 100, 150, 200)
"""Ticks of the logarithmic time axis, s."""


def draw(lines: Sequence[FrontierLine], title: str, folder: Path) -> list[Path]:
    """Draw the frontier and the chain into `folder` and return their files."""
    files = [folder / name for name in ("frontier.png", "chain.png")]
    draw_frontier(lines, title, files[0])
    draw_chain([line for line in lines if line.family == CHAIN], title, files[1])
    return files


def draw_frontier(lines: Sequence[FrontierLine], title: str, path: Path) -> None:
    """Draw a panel for the presets and one for each sweep, with everything else and the published point behind."""
    shown = [line for line in lines if line.family != CHAIN]
    families = list(dict.fromkeys(line.family for line in shown))
    columns = min(3, len(families))
    rows = math.ceil(len(families) / columns)
    figure = Figure(figsize=(4.6 * columns, 4.4 * rows + 0.7), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    timed = [line for line in shown if math.isfinite(line.mean)]
    low, _ = wilson(PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS)
    floor = 100 * min([low, *(line.low for line in timed)])
    times = [SHORTEST, PUBLISHED_TOTAL, *(line.mean for line in timed)]
    first, last = min(times) / 1.4, max(times) * 1.25
    for axes, family in zip(grid, families, strict=False):
        axes.set_xscale("log")
        axes.set_xlim(first, last)
        axes.set_xticks([tick for tick in TICKS if first <= tick <= last], minor=False)
        axes.set_xticks([], minor=True)
        axes.xaxis.set_major_formatter("{x:g}")
        axes.tick_params(labelbottom=True)
        axes.set_yscale("function", functions=(_stretch, _shrink))
        axes.set_ylim(max(floor - 3.0, -1.0), 100.4)
        axes.set_yticks([tick for tick in RATES if tick >= floor - 3.0])
        axes.grid(alpha=0.25)
        axes.set_title("presets" if family == PRESET else family, fontsize=11)
        others = [line for line in timed if line.family != family]
        if others:
            rates = [100 * line.successes / line.trials for line in others]
            axes.plot([line.mean for line in others], rates, "o", ms=3, color=GREY, ls="none", zorder=1, clip_on=False)
        _draw_family(axes, [line for line in shown if line.family == family])
    for axes in grid[len(families) :]:
        axes.remove()
    base = next((line.variant for line in shown if line.is_base), "")
    figure.supxlabel(
        "mean total time of the successes: search + insertion + adjustment (s), 95 % interval", fontsize=10
    )
    figure.supylabel("successful trials (%), Wilson 95 % interval", fontsize=10)
    figure.suptitle(
        f"Speed against accuracy\nBlack square: {PAPER}, {PUBLISHED_SUCCESSES}/{PUBLISHED_ATTEMPTS}, {PUBLISHED_TOTAL} s; "
        f"ring: the cell {base}; grey: the other panels; x: no success, so no time\n{title}",
        fontsize=10,
    )
    figure.savefig(path, dpi=150)


def _stretch(rate: Any) -> Any:
    """Return the place of a success rate, %, on an axis that is stretched near 100 %, where the variants differ."""
    return -np.log10(np.maximum(104.0 - np.asarray(rate, dtype=float), 1e-3))


def _shrink(place: Any) -> Any:
    """Undo `_stretch`."""
    return 104.0 - 10.0 ** -np.asarray(place, dtype=float)


def _draw_family(axes: Axes, lines: Sequence[FrontierLine]) -> None:
    """Draw one panel with a legend below it; names beside points that lie close together would cover each other."""
    low, high = wilson(PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS)
    rate = 100 * PUBLISHED_SUCCESSES / PUBLISHED_ATTEMPTS
    error = [[rate - 100 * low], [100 * high - rate]]
    axes.errorbar([PUBLISHED_TOTAL], [rate], yerr=error, fmt="s", color=INK, ms=7, capsize=3, lw=1)
    handles = []
    for place, line in enumerate(lines):
        colour, marker = COLOURS[place % len(COLOURS)], MARKERS[place % len(MARKERS)]
        counts = f"{line.successes}/{line.trials}, {line.mean:.1f} s"
        if not math.isfinite(line.mean):
            colour, marker = "#cc2222", "x"
            counts = f"{line.successes}/{line.trials}" if line.trials else "not run"
        handles += axes.plot([], [], marker, color=colour, ms=6, label=f"{line.variant}: {counts}")
        if not math.isfinite(line.mean):
            continue
        rate = 100 * line.successes / line.trials
        axes.errorbar(
            [line.mean],
            [rate],
            xerr=None if math.isnan(line.mean_error) else [[min(line.mean_error, 0.9 * line.mean)], [line.mean_error]],
            yerr=[[rate - 100 * line.low], [100 * line.high - rate]],
            fmt="none",
            color=colour,
            capsize=3,
            lw=1.2,
        )
        axes.plot([line.mean], [rate], marker, color=colour, ms=7, clip_on=False, zorder=3)
        if line.is_base:
            axes.plot([line.mean], [rate], "o", ms=14, mfc="none", mec=INK, mew=1.0, zorder=5, clip_on=False)
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2, fontsize=8.5, frameon=False)


def draw_chain(lines: Sequence[FrontierLine], title: str, path: Path) -> None:
    """Draw the effect of each step from the paper's method: success, time by stage, and largest force."""
    names = [PAPER, *(f"preset {line.variant}" if place == 0 else line.variant for place, line in enumerate(lines))]
    figure = Figure(figsize=(12.5, 1.9 + 0.5 * len(names)), layout="constrained")
    rate, time, force = figure.subplots(1, 3, sharey=True, width_ratios=(3, 4, 2.2))
    low, high = wilson(PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS)
    _success(rate, 0, PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS, low, high, INK)
    _stack(time, 0, [stage.time for stage in PUBLISHED], PUBLISHED_TOTAL)
    force.text(
        0.02, 0, "not published", transform=force.get_yaxis_transform(), va="center", fontsize=8, color="#666666"
    )
    for place, line in enumerate(lines, start=1):
        if not line.trials:
            rate.text(
                0.02,
                place,
                f"not run, see {FRONTIER}",
                transform=rate.get_yaxis_transform(),
                va="center",
                fontsize=7,
                color="r",
            )
            continue
        _success(rate, place, line.successes, line.trials, line.low, line.high, COLOURS[0])
        if math.isfinite(line.mean):
            stages = [0.0 if math.isnan(value) else value for value in (line.search, line.insert, line.adjust)]
            _stack(time, place, stages, line.mean, 0.0 if math.isnan(line.mean_error) else line.mean_error)
            if math.isfinite(line.mean_error):
                time.errorbar([line.mean], [place], xerr=[line.mean_error], color=INK, lw=1, capsize=3)
        else:
            time.text(
                0.02, place, "no success", transform=time.get_yaxis_transform(), va="center", fontsize=8, color="r"
            )
        force.plot([line.force_median, line.force_p95], [place, place], color="#aa3377", lw=1.5)
        force.plot([line.force_median], [place], "o", color="#aa3377", ms=6)
        force.plot([line.force_p95], [place], "|", color="#aa3377", ms=11, mew=2)
    rate.set_yticks(range(len(names)), names)
    rate.set_ylim(len(names) - 0.4, -0.6)
    left = min([low, *(line.low for line in lines if line.trials)])
    rate.set_xlim(100 * left - 6.0 * (1.05 - left), 100.0 + 6.0 * (1.05 - left))
    rate.set_xlabel("successful trials (%), Wilson 95 % interval")
    time.set_xlim(0.0, 1.22 * time.dataLim.x1)
    time.set_xlabel("mean time of the successes (s), 95 % interval")
    force.set_xlim(0.0, 1.08 * force.dataLim.x1 if any(line.trials for line in lines) else 1.0)
    force.set_xlabel("largest contact force (N):\ndot median, bar 95th percentile")
    handles = [time.barh([0], [0], color=colour, label=stage.label) for colour, stage in _stages()]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    for axes in (rate, time, force):
        axes.grid(axis="x", alpha=0.25)
        axes.set_axisbelow(True)
        axes.axhline(0.5, color=GREY, lw=1, ls="--")
    figure.suptitle(f"From the paper's method to the cell's, one step at a time\n{title}", fontsize=9)
    figure.savefig(path, dpi=150)


def _stages() -> Any:
    return zip(STAGES.values(), PUBLISHED, strict=True)


def _success(axes: Axes, place: int, successes: int, trials: int, low: float, high: float, colour: str) -> None:
    axes.plot([100 * low, 100 * high], [place, place], color=colour, lw=1.5, solid_capstyle="butt")
    axes.plot([100 * successes / trials], [place], "s" if place == 0 else "o", color=colour, ms=6)
    axes.annotate(
        f"{successes}/{trials}",
        (100 * successes / trials, place),
        xytext=(0, 6),
        textcoords="offset points",
        ha="center",
        fontsize=8,
        color=colour,
    )


def _stack(axes: Axes, place: int, times: Sequence[float], total: float, error: float = 0.0) -> None:
    left = 0.0
    for value, colour in zip(times, STAGES.values(), strict=True):
        axes.barh([place], [value], left=left, height=0.55, color=colour, alpha=0.45 if place == 0 else 1.0)
        left += value
    axes.annotate(
        f"{total:.1f} s", (total + error, place), xytext=(6, 0), textcoords="offset points", va="center", fontsize=8
    )
