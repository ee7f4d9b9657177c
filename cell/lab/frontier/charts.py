"""Charts of the frontier: success against time for each method and scene, and the errors behind it on the same time axis."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cell.lab.frontier.measure import FrontierLine
from cell.lab.frontier.methods import LONGEST, METHODS, SCENES, family
from cell.lab.published import PUBLISHED_ATTEMPTS, PUBLISHED_SUCCESSES, PUBLISHED_TOTAL
from cell.records.statistics import wilson

INK = "#222222"
TIMES = (3, 4, 5, 6, 8, 10, 15, 20, 30, 40, 60, 80, 120)
"""Ticks of the logarithmic time axis, s."""
SURE = 0.9
"""Share of successes of a sure method."""
TITLED = "shipped", "theta frozen after the grasp", "force alone"
"""Methods in the title."""
TIME = "mean time of the successes (s)"


def success(line: FrontierLine) -> float:
    """Return the share of successes, %."""
    return 100.0 * line.successes / line.trials


Rows = Sequence[tuple[str, Callable[[FrontierLine], float]]]
SUCCESS: Rows = (("success (%), bars: 95 % interval", success),)
ERRORS: Rows = (
    ("error of theta (degrees)", lambda line: math.degrees(line.theta)),
    ("error of the tip (mm)", lambda line: 1e3 * line.tip),
    ("largest force (N)", lambda line: line.force_median),
)
"""Rows of the two charts: name and value. The errors are medians over all trials of a point."""


@dataclass(frozen=True, slots=True)
class CurvePoint:
    """One row of the printed table."""

    curve: str
    speed: str
    """Value of `speed_scale`, or the name of a preset."""
    success: str
    low: float
    """Ends of the Wilson 95 % interval, %."""
    high: float
    mean: float
    """Mean time of the successes, s."""
    theta: float
    """Median error of theta, degrees; the next are the tip's, mm, and the largest force, N."""
    tip: float
    force: float
    endings: str


def points(lines: Sequence[FrontierLine]) -> list[CurvePoint]:
    """Return the rows of the printed table."""
    return [
        CurvePoint(
            line.family,
            line.variant,
            f"{line.successes}/{line.trials}",
            100 * line.low,
            100 * line.high,
            line.mean,
            math.degrees(line.theta),
            1e3 * line.tip,
            line.force_median,
            line.error or line.endings,
        )
        for line in lines
    ]


def draw(lines: Sequence[FrontierLine], conditions: str, folder: Path) -> list[Path]:
    """Draw the charts of the scenes that have lines into `folder`, each with its errors, and return their files."""
    shown = {name: scene.chart for name, scene in SCENES.items() if any(_has(lines, each, name) for each in METHODS)}
    return [
        path
        for chart in dict.fromkeys(shown.values())
        for path in _pair(lines, [name for name in shown if shown[name] == chart], conditions, folder / chart)
    ]


def _has(lines: Sequence[FrontierLine], method: str, scene: str) -> bool:
    return any(line.family == family(method, scene) for line in lines)


def _pair(lines: Sequence[FrontierLine], scenes: Sequence[str], conditions: str, stem: Path) -> list[Path]:
    """Draw success, and errors, of some scenes against time, and return both files."""
    by_success, by_errors = stem.with_suffix(".png"), stem.with_name(f"{stem.name}_errors.png")
    figure, grid = _figure(lines, scenes, SUCCESS)
    for axes, scene in zip(grid[0], scenes, strict=True):
        axes.set_ylim(-3.0, 118.0)
        axes.set_yticks(range(0, 101, 20))
        _mark(axes, lines, scene, has_labels=scene == scenes[0])
    _save(figure, finding(lines, scenes), conditions, by_success)
    figure, grid = _figure(lines, scenes, ERRORS)
    for row in grid:
        row[0].set_ylim(bottom=0.0)
    _save(figure, "Errors and force: medians over all trials of a point", conditions, by_errors)
    return [by_success, by_errors]


def _figure(lines: Sequence[FrontierLine], scenes: Sequence[str], rows: Rows) -> tuple[Figure, Any]:
    """Return a figure of all methods with a row for each quantity and a column for each scene, and its axes."""
    figure = Figure(figsize=(1.5 + 5.0 * len(scenes), 3.2 + 2.3 * len(rows)), layout="constrained")
    grid = figure.subplots(len(rows), len(scenes), sharex=True, sharey="row", squeeze=False)
    for row, (name, value) in zip(grid, rows, strict=True):
        row[0].set_ylabel(name)
        for axes, scene in zip(row, scenes, strict=True):
            for method in METHODS:
                _draw(axes, METHODS[method].colour, curve(lines, method, scene), value)
            _scale_times(axes)
    for column, scene in zip(grid.T, scenes, strict=True):
        column[0].set_title(scene, fontsize=11)
        column[-1].set_xlabel(TIME)
    handles = [
        Line2D([], [], marker="o", color=method.colour, label=_legend(lines, name, scenes))
        for name, method in METHODS.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9, frameon=False)
    return figure, grid


def _save(figure: Figure, title: str, conditions: str, path: Path) -> None:
    figure.suptitle(title, fontsize=12)
    figure.text(0.995, 0.005, conditions, fontsize=5.5, ha="right", color="#888888")
    figure.savefig(path, dpi=130)


def _draw(axes: Axes, colour: str, of: Sequence[FrontierLine], value: Callable[[FrontierLine], float]) -> None:
    """Draw one quantity of a method against time, from slow to quick; of the success, with its 95 % interval.

    A point with at most half inserted is hollow and not joined: the mean time of few successes says little.
    """
    joined = [line for line in of if success(line) > 50.0]
    apart = [line for line in of if 0.0 < success(line) <= 50.0]
    times, values = [line.mean for line in joined], [value(line) for line in joined]
    axes.plot(times, values, "o-", ms=5, lw=1.8, color=colour)
    axes.plot([line.mean for line in apart], [value(line) for line in apart], "o", ms=5, mfc="none", color=colour)
    if value is success:
        low = [success(line) - 100.0 * line.low for line in joined]
        high = [100.0 * line.high - success(line) for line in joined]
        axes.errorbar(times, values, yerr=[low, high], fmt="none", ecolor=colour, alpha=0.35, lw=4)


def _scale_times(axes: Axes) -> None:
    axes.set_xscale("log")
    axes.set_xlim(TIMES[0], LONGEST)
    axes.set_xticks(TIMES, minor=False)
    axes.set_xticks([], minor=True)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.grid(alpha=0.25)


def _legend(lines: Sequence[FrontierLine], method: str, scenes: Sequence[str]) -> str:
    """Return the name of a method; with its count if it has no success, and so no point."""
    of = [line for line in lines if line.family in {family(method, scene) for scene in scenes} and line.trials]
    is_hidden = of and not any(line.successes for line in of)
    return f"{method}: 0 of {sum(line.trials for line in of)}" if is_hidden else method


def _mark(axes: Axes, lines: Sequence[FrontierLine], scene: str, has_labels: bool) -> None:
    """Draw the presets, and in the scene of the real insertions also those."""
    above: dict[str, Any] = {"textcoords": "offset points", "fontsize": 9, "ha": "center"}
    for method, points in ((name, each.points) for name, each in METHODS.items()):
        marked = [each for each in lines if each.family == family(method, scene) and each.variant in points]
        for step, line in enumerate(sorted(marked, key=lambda line: line.mean)):
            at = line.mean, success(line)
            axes.plot(*at, "D", ms=8, color=METHODS[method].colour, mec=INK, mew=1.0, zorder=5)
            axes.annotate(line.variant if has_labels else "", at, xytext=(0, 8 + 11 * step), **above)
    if scene == next(iter(SCENES)):
        rate = 100.0 * PUBLISHED_SUCCESSES / PUBLISHED_ATTEMPTS
        low, high = (100.0 * end for end in wilson(PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS))
        error = [[rate - low], [high - rate]]
        axes.errorbar([PUBLISHED_TOTAL], [rate], yerr=error, fmt="s", color=INK, ms=7, capsize=3, lw=1)
        axes.annotate("[gibbons], 40 real", (PUBLISHED_TOTAL, high), xytext=(0, 8), **above)


def curve(lines: Sequence[FrontierLine], method: str, scene: str) -> list[FrontierLine]:
    """Return the points of a curve from slow to quick, without the presets."""
    of = [line for line in lines if line.family == family(method, scene) and line.trials]
    return sorted((line for line in of if _scale(line) is not None), key=lambda line: _scale(line) or 0.0)


def finding(lines: Sequence[FrontierLine], scenes: Sequence[str]) -> str:
    """Return the finding in one sentence: the least mean time with `SURE` inserted, or the best success."""
    told = []
    for scene in scenes:
        found = {
            method: _quickest([line for line in lines if line.family == family(method, scene)]) for method in TITLED
        }
        parts = [f"{method} {text}" for method, text in found.items() if text]
        told += [f"{scene}: {', '.join(parts)}"] if parts else []
    return f"Least mean time to insert {100 * SURE:.0f} % - " + ";\n".join(told)


def _quickest(lines: Sequence[FrontierLine]) -> str:
    shares = {line.mean: line.successes / line.trials for line in lines if line.trials}
    sure = [time for time, share in shares.items() if share >= SURE]
    return f"{min(sure):.1f} s" if sure else f"not reached ({100 * max(shares.values()):.0f} %)" if shares else ""


def _scale(line: FrontierLine) -> float | None:
    found = [text.split("=")[1] for text in line.sets.split() if text.startswith("speed_scale=")]
    return float(found[0]) if found else None
