"""Charts of the frontier: losses against time with force as colour, in one picture and one panel per group; and the
chain from the paper's method to the default one.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from cell.lab.charts import Label, place_labels
from cell.lab.frontier.measure import FRONTIER, FrontierLine
from cell.lab.frontier.variants import BASES, CHAIN, PRESET
from cell.lab.frontier.variants import PUBLISHED as METHOD
from cell.lab.published import PUBLISHED, PUBLISHED_ATTEMPTS, PUBLISHED_SUCCESSES, PUBLISHED_TOTAL
from cell.records.statistics import wilson

INK, GREY, RED, BLUE = "#222222", "#999999", "#cc2222", "#4477aa"
STAGES = dict(zip(("search", "insert", "adjust"), ("#66ccee", "#228833", "#ccbb44"), strict=True))
"""Colour of each stage."""
MARKERS = "osD^vPX*"
"""Markers of a panel's variants, in order."""
FORCES = (10.0, 12.5, 15.0, 17.5, 20.0, 25.0, 30.0, 40.0, 60.0)
"""Bounds of the force bands of the colours, N; 20 N is the bound of the default settings."""
MAP = ListedColormap(
    [colormaps["RdYlBu_r"](place) for place in (0.0, 0.08, 0.17, 0.26, 0.36, 0.62, 0.7, 0.8, 0.9, 1.0)]
)
"""Colours of the bands and of the range beyond them: blue up to 20 N, red above."""
NORM = BoundaryNorm(FORCES, MAP.N, extend="both")
NONE, LEAST, MOST = 0.55, 0.4, 125.0
"""Position of zero losses on the logarithmic axis of losses, and the axis' ends, %."""
SHARES = (1, 2, 5, 10, 20, 50, 100)
"""Ticks of the axis of losses, %."""
TIMES = (4, 5, 6, 8, 10, 15, 20, 30, 40, 60, 80, 100, 150)
"""Ticks of the logarithmic time axis, s."""
PAPER = "[gibbons], Table I, real"
REMARKABLE = 1.3
"""Factor between a setting's time and that of the base, in either direction, above which a setting without losses gets
a label."""
LOST = "trials lost (%), Wilson 95 % interval"
TIME = "mean time of the successes: search + insertion + adjustment (s), 95 % interval"
FORCE = "largest contact force of a trial, 95th percentile (N)"


def draw(lines: Sequence[FrontierLine], title: str, folder: Path) -> list[Path]:
    """Draw picture, panels and chain into `folder`; return the files with lines."""
    shown, steps = ([line for line in lines if (line.family == CHAIN) == is_step] for is_step in (False, True))
    files = [folder / name for name in ("frontier.png", "frontier_panels.png", "chain.png")]
    if shown:
        draw_picture(shown, title, files[0])
        draw_panels(shown, title, files[1])
    if steps:
        draw_chain(steps, title, files[2])
    return files[:2] * bool(shown) + files[2:] * bool(steps)


def draw_picture(lines: Sequence[FrontierLine], title: str, path: Path) -> None:
    """Draw every variant in one picture.

    A line joins the settings of one group; notable variants have a label.
    """
    figure = Figure(figsize=(11.0, 7.4), layout="constrained")
    axes = figure.add_subplot()
    timed = [line for line in lines if math.isfinite(line.mean)]
    _prepare(axes, timed)
    base = next((line for line in timed if line.is_base), None)
    labels = []
    for family in dict.fromkeys(line.family for line in timed):
        of = [line for line in timed if line.family == family]
        if family not in (PRESET, METHOD):
            axes.plot([line.mean for line in of], [_lost(line) for line in of], "-", color=GREY, lw=0.7, zorder=1)
        for line in of:
            is_named = _is_remarkable(line, base)
            _point(axes, line, "D" if family == PRESET else "s" if family == METHOD else "o", 10 if is_named else 6)
            if is_named:
                _bars(axes, line, 1.0)
                labels.append(Label(line.mean, _lost(line), _name(line), is_bold=family == PRESET))
    labels.append(_published(axes))
    bar = figure.colorbar(ScalarMappable(NORM, MAP), ax=axes, ticks=FORCES, fraction=0.04, pad=0.01)
    bar.set_label(FORCE)
    bar.ax.axhline(20.0, color=INK, lw=2)
    axes.set_xlabel(TIME)
    axes.set_ylabel(LOST)
    hidden = sorted(
        {f"{line.family} {line.variant}, 0/{line.trials}" for line in lines if line.trials and line not in timed}
    )
    figure.suptitle("Speed against accuracy: quicker is further left, surer further down", fontsize=13)
    axes.set_title(
        f"{title}" + (f"\nwithout a success, so without a time: {'; '.join(hidden)}" if hidden else ""), fontsize=7.5
    )
    place_labels(figure, axes, labels)
    figure.savefig(path, dpi=130)


def draw_panels(lines: Sequence[FrontierLine], title: str, path: Path) -> None:
    """Draw a panel for each group, with the other groups and the published point in the background."""
    groups = {family: [line for line in lines if line.family == family] for family in (line.family for line in lines)}
    groups[PRESET] = [*groups.get(PRESET, []), *groups.pop(METHOD, [])]
    groups = {family: of for family, of in groups.items() if of}
    rows = math.ceil(len(groups) / 2)
    figure = Figure(figsize=(11.0, 4.3 * rows + 1.2), layout="constrained")
    grid = figure.subplots(rows, 2, sharex=True, sharey=True, squeeze=False).ravel()
    timed = [line for line in lines if math.isfinite(line.mean)]
    for axes, (family, of) in zip(grid, groups.items(), strict=False):
        _prepare(axes, timed)
        axes.set_title("presets, and the published method" if family == PRESET else family, fontsize=11)
        for line in timed:
            axes.plot([line.mean], [_lost(line)], "o", ms=3, color="#cccccc", zorder=1)
        _published(axes)
        handles = [_drawn(axes, line, MARKERS[place % len(MARKERS)]) for place, line in enumerate(of)]
        axes.legend(
            handles=handles,
            loc="upper center",
            bbox_to_anchor=(0.5, -0.08),
            ncols=2,
            fontsize=8,
            frameon=False,
            columnspacing=1.0,
            handletextpad=0.2,
        )
    for axes in grid[len(groups) :]:
        axes.remove()
    bar = figure.colorbar(
        ScalarMappable(NORM, MAP), ax=list(grid[: len(groups)]), ticks=FORCES, fraction=0.02, aspect=60
    )
    bar.set_label(FORCE)
    figure.supxlabel(TIME, fontsize=10)
    figure.supylabel(LOST, fontsize=10)
    figure.suptitle(
        f"Speed against accuracy, group by group\nblack: {PAPER}; ring: the cell {BASES[0]}; grey: the other groups; x: no success\n"
        f"{title}",
        fontsize=9,
    )
    figure.savefig(path, dpi=120)


def _lost(line: FrontierLine) -> float:
    """Return the position of a variant on the axis of losses, %."""
    return _place(1.0 - line.successes / line.trials)


def _place(share: float) -> float:
    return max(100.0 * share, NONE)


def _is_remarkable(line: FrontierLine, base: FrontierLine | None) -> bool:
    """Return True if a variant gets a label in the picture."""
    if line.family in (PRESET, METHOD):
        return not (line.variant != BASES[0] and line.is_base)
    if line.is_base:
        return False
    ratio = line.mean / base.mean if base is not None else 1.0
    return line.successes < line.trials or not 1.0 / REMARKABLE < ratio < REMARKABLE


def _name(line: FrontierLine) -> str:
    """Return the label of a variant in the picture, with its count."""
    if line.family == METHOD:
        text = f"[gibbons], simulated, {line.variant}"
    elif line.family == PRESET:
        text = line.variant
    else:
        text = line.variant if line.family in ("size of the errors", "part") else f"{line.family} {line.variant}"
    return f"{text}: {line.successes}/{line.trials}"


def _prepare(axes: Axes, timed: Sequence[FrontierLine]) -> None:
    """Prepare both logarithmic axes, with a separate position for zero losses."""
    times = [6.0, PUBLISHED_TOTAL, *(line.mean for line in timed)]
    first, last = min(times) / 1.35, max(times) * 1.4
    axes.set_xscale("log")
    axes.set_xlim(first, last)
    axes.set_xticks([tick for tick in TIMES if first <= tick <= last], minor=False)
    axes.set_xticks([], minor=True)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.tick_params(labelbottom=True, labelleft=True)
    axes.set_yscale("log")
    axes.set_ylim(LEAST, MOST)
    axes.set_yticks((NONE, *SHARES), ("none", *map(str, SHARES)))
    axes.set_yticks([], minor=True)
    axes.axhspan(LEAST, 0.75, color="#eef5ee", zorder=0)
    axes.grid(alpha=0.25)


def _colour(line: FrontierLine) -> Any:
    return MAP(NORM(line.force_p95))


def _point(axes: Axes, line: FrontierLine, marker: str, size: float) -> None:
    axes.plot(
        [line.mean], [_lost(line)], marker, ms=size, color=_colour(line), mec=INK, mew=0.8, zorder=4, clip_on=False
    )
    if line.is_base:
        axes.plot([line.mean], [_lost(line)], "o", ms=1.9 * size, mfc="none", mec=INK, mew=1.2, zorder=5, clip_on=False)


def _bars(axes: Axes, line: FrontierLine, width: float) -> None:
    """Draw both intervals of a variant."""
    lost = _lost(line)
    below, above = lost - _place(1.0 - line.high), _place(1.0 - line.low) - lost
    late = None if math.isnan(line.mean_error) else [[min(line.mean_error, 0.9 * line.mean)], [line.mean_error]]
    axes.errorbar(
        [line.mean], [lost], xerr=late, yerr=[[below], [above]], fmt="none", ecolor=INK, alpha=0.35, capsize=2, lw=width
    )


def _published(axes: Axes) -> Label:
    """Draw the published point, whose force is unknown, and return its name."""
    low, high = wilson(PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS)
    lost = _place(1.0 - PUBLISHED_SUCCESSES / PUBLISHED_ATTEMPTS)
    error = [[lost - _place(1.0 - high)], [_place(1.0 - low) - lost]]
    axes.errorbar([PUBLISHED_TOTAL], [lost], yerr=error, fmt="s", color=INK, ms=9, capsize=3, lw=1, zorder=3)
    return Label(PUBLISHED_TOTAL, lost, f"{PAPER}: {PUBLISHED_SUCCESSES}/{PUBLISHED_ATTEMPTS}", is_bold=True)


def _drawn(axes: Axes, line: FrontierLine, marker: str) -> Any:
    """Draw one variant in its panel and return its legend entry."""
    if not math.isfinite(line.mean):
        told = f"{line.successes}/{line.trials}" if line.trials else "not run"
        return axes.plot([], [], "x", color=RED, ms=6, label=f"{line.variant}: {told}")[0]
    _bars(axes, line, 1.2)
    _point(axes, line, marker, 8)
    told = f"{line.variant}: {line.successes}/{line.trials}, {line.mean:.1f} s, {line.force_p95:.0f} N"
    return axes.plot([], [], marker, color=_colour(line), mec=INK, ms=7, label=told)[0]


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
        _success(rate, place, line.successes, line.trials, line.low, line.high, BLUE)
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
    force.set_xlabel("largest contact force (N),\nmedian and 95th percentile")
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
