"""Charts of the estimators: speed against accuracy, error over the angle, and the cost of each condition."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cell.lab.tactile.measure import (
    CONDITIONS,
    COVERED,
    ESTIMATORS,
    WRONG,
    Read,
    TactileLine,
    kinds,
)
from drivers.skin.layout import LAYOUTS

COLOURS = dict(zip(ESTIMATORS, ("#888888", "#4477aa", "#aa3377"), strict=True))
"""Colours of the estimators, distinguishable by colour-blind readers."""
MARKERS = dict(zip(ESTIMATORS, "s^o", strict=True))
TITLES = {"parallelogram": "layout P: parallelogram", "base_to_base": "layout D: base to base"}
GOAL_ERROR, GOAL_TIME = 0.8, 100.0
"""Targets of the default estimator at nominal noise on layout P: degrees, and us per frame."""
SHOWN = 15.0
"""Largest error drawn to scale, degrees; larger errors are drawn at the edge."""


def draw(lines: Sequence[TactileLine], nominal: Mapping[tuple[str, str], Sequence[Read]], folder: Path) -> list[Path]:
    """Draw all charts into `folder`; return their files."""
    files = [folder / f"tactile_{name}.png" for name in ("speed_accuracy", "error_over_theta", "conditions")]
    _speed_accuracy(lines, files[0])
    _error_over_theta(nominal, files[1])
    _conditions(lines, files[2])
    return files


def _speed_accuracy(lines: Sequence[TactileLine], path: Path) -> None:
    figure = Figure(figsize=(12, 5.5), layout="constrained")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, layout in zip(panels, LAYOUTS, strict=True):
        axes.axhline(GOAL_ERROR, color="#bbbbbb", lw=1, ls="--", zorder=0)
        axes.axvline(GOAL_TIME, color="#bbbbbb", lw=1, ls="--", zorder=0)
        for line in lines:
            if line.layout != layout or line.condition != CONDITIONS[0].name:
                continue
            is_springs = line.model == "springs"
            # The bars of both pad models stand side by side for each estimator.
            x = 1e6 * line.time * (0.96 if is_springs else 1.04)
            colour = COLOURS[line.estimator]
            axes.plot([x, x], [line.rmse, line.worst], color=colour, lw=1, zorder=1)
            axes.plot([x], [line.p95], marker="_", ms=9, color=colour)
            axes.plot([x], [line.worst], marker="x", ms=6, color=colour)
            axes.plot(
                [x],
                [line.rmse],
                marker=MARKERS[line.estimator],
                ms=9,
                color=colour,
                mfc=colour if is_springs else "white",
                ls="none",
                label=f"{line.estimator}, {line.model}",
            )
        _logarithmic(axes.xaxis, (10, 20, 50, 100, 200))
        _logarithmic(axes.yaxis, (0.5, 1, 2, 5, 10, 20))
        axes.set_title(_title(layout, lines))
        axes.set_xlabel("median time for one frame (us)")
        axes.grid(alpha=0.25)
    panels[0].set_ylabel("error of theta (degrees)")
    figure.legend(*panels[0].get_legend_handles_labels(), fontsize=8, loc="outside lower center", ncols=8)
    figure.suptitle(
        "Nominal noise. Symbol: RMSE, bar: 95th percentile, cross: worst; filled: bed of springs, hollow: elastic layer; dashed: goals"
    )
    figure.savefig(path, dpi=120)


def _title(layout: str, lines: Sequence[TactileLine]) -> str:
    count = max(line.frames for line in lines)
    # The standard error of an RMSE is RMSE / sqrt(2 n), for Gaussian errors.
    return f"{TITLES[layout]}; n = {count}, RMSE within {100 * COVERED / math.sqrt(2 * count):.0f} % (95 %)"


def _logarithmic(axis: object, ticks: Sequence[float]) -> None:
    axes = axis.axes  # type: ignore[attr-defined]
    name = axis.axis_name  # type: ignore[attr-defined]
    getattr(axes, f"set_{name}scale")("log")
    getattr(axes, f"set_{name}ticks")(ticks, [f"{tick:g}" for tick in ticks])
    getattr(axes, f"set_{name}ticks")([], minor=True)


def _error_over_theta(nominal: Mapping[tuple[str, str], Sequence[Read]], path: Path) -> None:
    figure = Figure(figsize=(12, 9), layout="constrained")
    grid = figure.subplots(len(ESTIMATORS), len(LAYOUTS), sharex=True, sharey=True, squeeze=False)
    for row, name in enumerate(ESTIMATORS):
        for column, layout in enumerate(LAYOUTS):
            _draw_errors(grid[row, column], nominal[layout, name], COLOURS[name])
            if row == 0:
                grid[row, column].set_title(TITLES[layout])
        grid[row, 0].set_ylabel(f"{name}\nerror (degrees)")
    for axes in grid[-1]:
        axes.set_xlabel("theta (degrees)")
    frames = len(next(iter(nominal.values())))
    figure.suptitle(
        f"Nominal noise, bed of springs, n = {frames} a panel; line: moving mean; red cross: told and wrong by more than "
        f"{np.degrees(WRONG):.0f} degrees; tick at the foot: not told"
    )
    figure.savefig(path, dpi=120)


def _draw_errors(axes: Axes, reads: Sequence[Read], colour: str) -> None:
    theta, error = (np.degrees([getattr(read, name) for read in reads]) for name in ("theta", "error"))
    told = np.array([read.healthy for read in reads])
    failed = told & (np.abs(error) > np.degrees(WRONG))
    axes.axhspan(-np.degrees(WRONG), np.degrees(WRONG), color="#eeeeee", zorder=0)
    fine = told & ~failed
    axes.plot(theta[fine], error[fine], ".", ms=3, color=colour, alpha=0.7)
    axes.plot(theta[failed], np.clip(error[failed], -SHOWN, SHOWN), "x", ms=5, color="#cc2222")
    axes.plot(theta[~told], np.full(np.count_nonzero(~told), -SHOWN), "|", ms=9, color="#cc2222")
    order = np.argsort(theta[told])
    width = max(5, len(order) // 40)
    if len(order) > 2 * width:
        kernel = np.ones(width) / width
        mean = [np.convolve(values[told][order], kernel, mode="valid") for values in (theta, error)]
        axes.plot(*mean, color="#222222", lw=1)
    rmse = np.sqrt(np.mean(error[told] ** 2)) if told.any() else np.nan
    axes.text(0.01, 0.94, f"RMSE {rmse:.2f}", transform=axes.transAxes, va="top", fontsize=9)
    axes.set_ylim(-SHOWN - 1.0, SHOWN + 1.0)
    axes.margins(x=0.02)


def _named(model: str, condition: str) -> str:
    return condition if model == "springs" else f"layer, {condition}"


def _conditions(lines: Sequence[TactileLine], path: Path) -> None:
    figure = Figure(figsize=(15, 7), layout="constrained")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    names = [_named(model, condition.name) for model, condition in kinds()]
    for axes, layout in zip(panels, LAYOUTS, strict=True):
        for line in lines:
            if line.layout != layout:
                continue
            place = names.index(_named(line.model, line.condition))
            y = place + 0.18 * (ESTIMATORS.index(line.estimator) - 1.0)
            colour = COLOURS[line.estimator]
            label = line.estimator if place == 0 else None
            axes.plot([line.rmse, line.worst], [y, y], color=colour, lw=1)
            axes.plot([line.worst], [y], "x", ms=5, color=colour)
            axes.plot([line.rmse], [y], MARKERS[line.estimator], ms=6, color=colour, label=label)
            if line.told < 0.995:
                axes.text(line.worst * 1.08, y, f"told {100 * line.told:.0f} %", fontsize=7, va="center", color=colour)
        _logarithmic(axes.xaxis, (0.5, 1, 2, 5, 10, 20, 50))
        axes.set_xlim(0.25, 250.0)
        axes.set_yticks(range(len(names)), names)
        axes.set_title(_title(layout, lines))
        axes.set_xlabel("error of theta (degrees)")
        axes.grid(axis="x", alpha=0.25)
    panels[0].invert_yaxis()
    panels[0].legend(fontsize=8, loc="lower right")
    figure.suptitle(
        "What each condition costs, on the bed of springs and on the elastic layer. Symbol: RMSE of the angles told, cross: worst of them"
    )
    figure.savefig(path, dpi=120)
