"""The facts of a report as drawings."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cell.records.statistics import spread
from cell.report.facts import WORN, Facts
from drivers.quantities import Vector

GOOD, BAD, PLAIN, FAINT = "#228833", "#bb4455", "#4477aa", "#9aa5ad"
"""Colours that colour-blind readers can distinguish."""
MOST_LOSSES, MOST_SHIFTS = 8, 93
"""Largest number of kinds of losses, and of shifts, in a drawing; 93 shifts are a month with three shifts a day."""
COLOURS = ("#222222", "#bbbbbb", "#4477aa", "#66ccee", "#228833", "#ccbb44", "#ee6677", "#aa3377")
MOST_POINTS, SPANS = 2000, 100
"""Largest number of runs drawn as single points; more runs are drawn as this number of spans."""


def draw(facts: Facts) -> Figure:
    """Return one figure with the drawings of a report, with the proportions of A4."""
    figure = Figure(figsize=(11.7, 8.3), layout="constrained")
    places = figure.subplot_mosaic(
        [["yield", "losses"], ["trends", "losses"], ["stages", "drift"], ["forces", "drift"]]
    )
    kinds: dict[str, Callable[[Axes, Facts], None]] = {
        "yield": _yield,
        "trends": _trends,
        "losses": _losses,
        "stages": _stages,
        "forces": _forces,
        "drift": _drift,
    }
    for name, kind in kinds.items():
        kind(places[name], facts)
        places[name].title.set_fontsize(11)
        places[name].spines[["top", "right"]].set_visible(False)
    return figure


def _yield(axes: Axes, facts: Facts) -> None:
    shifts = facts.shifts[-MOST_SHIFTS:]
    axes.set_title(f"Yield with its 95 % interval, and availability, n = {facts.total.runs}")
    for place, shift in enumerate(shifts):
        low, high = shift.runs.interval
        axes.plot([place, place], [100 * low, 100 * high], color=FAINT, lw=3)
        axes.plot(place, 100 * (shift.runs.share or 0.0), "o", color=GOOD, ms=4)
    axes.plot(
        [100 * (np.nan if shift.availability is None else shift.availability) for shift in shifts], color=PLAIN, lw=1
    )
    axes.set_ylim(0, 103)
    axes.set_ylabel("%; blue: available")
    _name_shifts(axes, [shift.start for shift in shifts])


def _trends(axes: Axes, facts: Facts) -> None:
    axes.set_title("Mean times of successful runs by shift, with their limits")
    shifts = [shift.start for shift in facts.shifts[-MOST_SHIFTS:]]
    for trend, colour in zip(facts.trends, COLOURS, strict=False):
        means = [trend.means.get(shift, np.nan) for shift in shifts]
        axes.plot(means, ".-", color=colour, lw=1, ms=4, label=trend.name.replace("_", " "))
        for limit in trend.limits or ():
            axes.axhline(limit, color=colour, lw=0.6, ls="--")
    if facts.trends:
        axes.legend(fontsize=6, loc="upper left")
    axes.set_ylim(bottom=0)
    axes.set_ylabel("s, with transfers")
    _name_shifts(axes, shifts)


def _name_shifts(axes: Axes, shifts: list[str]) -> None:
    every = max(1, -(-len(shifts) // 8))
    axes.set_xticks(range(0, len(shifts), every), [shift[5:].replace(" ", "\n") for shift in shifts[::every]])
    axes.tick_params(axis="x", labelsize=7)


def _losses(axes: Axes, facts: Facts) -> None:
    losses = list(facts.losses)[:MOST_LOSSES]
    axes.set_title("Where time was lost")
    if not losses:
        axes.text(
            0.5, 0.5, "every run succeeded" if facts.total.runs else "no runs", ha="center", transform=axes.transAxes
        )
        axes.set_axis_off()
        return
    rows = range(len(losses))
    axes.barh(rows, [loss.minutes for loss in losses], color=BAD, height=0.6)
    for row, loss in zip(rows, losses, strict=True):
        axes.text(0.02 * losses[0].minutes, row - 0.42, loss.what, fontsize=8, va="center")
        axes.text(
            loss.minutes,
            row,
            f" {loss.minutes:.1f} min, {loss.count} runs, cumulative {100 * loss.cumulative:.0f} %",
            fontsize=8,
            va="center",
        )
    axes.set_xlim(0, 1.7 * max(losses[0].minutes, 0.1))
    axes.set_ylim(len(losses) - 0.4, -0.7)
    axes.set_yticks([])
    axes.set_xlabel("time until the next start (min)")


def _stages(axes: Axes, facts: Facts) -> None:
    axes.set_title("Time by stage, median and 95th percentile of successful runs")
    names = []
    for row, stage in enumerate(facts.stages):
        names.append(f"{stage.name.replace('_', ' ')}, n = {stage.n}")
        for times, colour, shift in ((stage.whole, FAINT, 0.14), (stage.counted, PLAIN, -0.14)):
            if times is not None:
                axes.barh(row + shift, times["median"], height=0.26, color=colour)
                axes.plot([times["median"], times["p95"]], [row + shift] * 2, color="#333333", lw=1)
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.invert_yaxis()
    axes.set_xlabel("s; blue: the stage alone, grey: with the transfer to its place")


def _forces(axes: Axes, facts: Facts) -> None:
    axes.set_title(f"Largest force of each run, n = {len(facts.forces)}")
    if facts.forces:
        axes.hist(np.array(facts.forces), bins=min(30, max(5, len(facts.forces) // 3)), color=PLAIN)
        found = spread(facts.forces)
        assert found is not None
        axes.axvline(found["median"], color="#333333", lw=1, ls="--", label=f"median {found['median']:.1f} N")
        axes.legend(fontsize=8)
    axes.set_xlabel("N")
    axes.set_ylabel("runs")


def _drift(axes: Axes, facts: Facts) -> None:
    axes.set_title("Residual of theta after the grasp")
    if facts.residuals:
        time, value = np.array(facts.residuals).T
        if len(time) > MOST_POINTS:
            _spans(axes, time, value)
        else:
            axes.plot(time, value, ".", color=FAINT, ms=4)
        if facts.drift is not None:
            middle = value.mean() + facts.drift.per_day * (time - time.mean())
            axes.plot(time, middle, color=BAD if facts.drift.is_shown else PLAIN, lw=1.5)
        axes.axhline(WORN, color=BAD, lw=0.8, ls="--", label=f"limit {WORN}: change the pads")
        axes.legend(fontsize=8)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("days since the first run")
    axes.set_ylabel("residual (0 to 1), rises with wear")


def _spans(axes: Axes, time: Vector, value: Vector) -> None:
    """Draw median and 10th to 90th percentile of the values, in spans with equal numbers of runs, instead of single points."""
    spans = [np.array_split(values[np.argsort(time, kind="stable")], SPANS) for values in (time, value)]
    middle = [float(span.mean()) for span in spans[0]]
    low, median, high = np.array([np.percentile(span, (10, 50, 90)) for span in spans[1]]).T
    axes.fill_between(middle, low, high, color=FAINT, lw=0, alpha=0.5, label=f"10 to 90 % of {len(time) // SPANS} runs")
    axes.plot(middle, median, color=FAINT, lw=1.5, label="their median")
