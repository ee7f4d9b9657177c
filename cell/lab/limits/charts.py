"""Chart of the limits: a panel for each phase, with the unreachable range in grey and the trials' results as points."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from cell.lab.limits.bounds import Dip, fall_depth, turn_force
from cell.lab.limits.cases import FAST, STATED
from cell.lab.limits.lines import STILL, Study
from drivers.quantities import Vector
from sim.metering import OVER_FORCE
from skills.play import allowed_tilt

CHART = "limits.png"
INK, BEYOND, BLUE, RED, GREEN, GREY = "#222222", "#e6e6e6", "#4477aa", "#ee6677", "#228833", "#888888"
JAMMED = "#aa3377"
LOOKS: tuple[dict[str, Any], ...] = (
    {"ms": 4.0, "alpha": 0.35, "zorder": 4.0},
    {"ms": 9.0, "alpha": 0.75, "zorder": 5.0},
)
"""Styles of scans of pegs that move down, and of pegs at rest."""
LEAST_SHARE = 0.15
"""Smallest share of the cover for drawing a trial separately; shorter paths consist mostly of touch-down and rest."""
SMALL = 9
"""Size of the letters of notes and legends."""


def draw(studies: Sequence[Study], title: str, folder: Path) -> Path:
    """Draw all panels; return the file."""
    figure = Figure(figsize=(16.0, 10.2))
    figure.set_layout_engine("constrained", w_pad=0.12, h_pad=0.1)
    grid = figure.subplots(2, 3)
    sized = [study for study in studies if study.case.is_preset]
    stated = [study for study in sized if study.case.size == STATED]
    _cover(grid[0, 0], sized)
    _band(grid[0, 1], [study for study in studies if study.case.size == STATED])
    _fall(grid[0, 2], stated)
    _turn(grid[1, 0], [*stated, *(study for study in studies if study.case.variant.family == "turn")])
    _down(grid[1, 1], stated)
    _lean(grid[1, 2], stated)
    for axes in grid.ravel():
        axes.grid(alpha=0.25, zorder=0)
        axes.set_axisbelow(True)
    handles: list[Artist] = [Line2D([], [], color=INK, lw=2, label="bound"), Patch(color=BEYOND, label="beyond it")]
    for study in stated:
        handles.append(Line2D([], [], color=colour_of(study), marker="o", lw=1, label=study.case.label))
    handles.append(Line2D([], [], color=GREEN, marker="o", lw=0, label="other speeds and turns"))
    figure.suptitle("What limits each phase, and what trials reach\n", fontsize=16, fontweight="bold")
    figure.legend(
        handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.972), ncols=len(handles), fontsize=11, frameon=False
    )
    figure.supxlabel(title, fontsize=9, color="#666666")
    path = folder / CHART
    figure.savefig(path, dpi=100)
    return path


def colour_of(study: Study) -> str:
    """Return the colour of a case."""
    return RED if study.case.label == FAST else BLUE if study.case.is_preset else GREEN


def _titled(axes: Axes, name: str, what: str) -> None:
    axes.set_title(f"{name}\n", loc="left", fontsize=13, fontweight="bold")
    axes.text(0.0, 1.02, what, transform=axes.transAxes, fontsize=10, color="#444444", in_layout=False)


def _note(axes: Axes, place: tuple[float, float], text: str, colour: str = INK, side: str = "left") -> None:
    box = {"boxstyle": "square,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.75}
    axes.text(*place, text, fontsize=SMALL, color=colour, ha=side, va="center", zorder=7, bbox=box)


def _style(axes: Axes, *lines: tuple[str, str, float, str], is_left: bool = False) -> None:
    """Add a legend of lines and markers: style, colour, width and name of each."""
    handles = [
        Line2D([], [], color=colour, lw=width, label=label, ls=style)
        if style in ("-", "--", ":")
        else Line2D([], [], color=colour, ls="none", marker=style, ms=6.0, label=label)
        for style, colour, width, label in lines
    ]
    axes.legend(handles=handles, loc="upper left" if is_left else "upper right", fontsize=SMALL, frameon=False)


def _cover(axes: Axes, sized: Sequence[Study]) -> None:
    """Draw the time of a cover against the diameter of the peg."""
    _titled(axes, "Search", "lanes as quick and as far apart as a fall can still be told")
    own = [study for study in sized if study.case.label != FAST and study.mass > 0.0]
    if own:
        sizes, bounds = [1e3 * study.case.size for study in own], [study.cover().time for study in own]
        axes.fill_between(sizes, 0.0, bounds, color=BEYOND, zorder=1)
        axes.plot(sizes, bounds, "o-", color=INK, lw=2, ms=3, zorder=3)
    for label in dict.fromkeys(study.case.label for study in sized):
        of = [study for study in sized if study.case.label == label]
        colour, shift = colour_of(of[0]), 0.13 if label == FAST else -0.13
        laid = [float(np.median([row.cover for row in study.rows if row.cover] or [math.nan])) for study in of]
        places = [1e3 * study.case.size + shift for study in of]
        axes.plot(places, laid, "--", color=colour, lw=1.2, zorder=3)
        for place, study in zip(places, of, strict=True):
            for row in study.rows:
                if row.search_time and row.share and row.share > LEAST_SHARE:
                    axes.plot(place, row.search_time / row.share, ".", color=colour, alpha=0.45, ms=6, mew=0.0)
        reached = [study.searched() for study in of]
        values, errors = [value for value, _ in reached], [error for _, error in reached]
        axes.errorbar(places, values, yerr=errors, fmt="o", color=colour, capsize=3, ms=6, zorder=4)
    _style(
        axes,
        ("-", INK, 2.0, "bound: the shortest cover without a miss"),
        ("--", GREY, 1.2, "as the lanes are laid"),
        ("o", GREY, 0.0, "reached, 95 % interval; dots are trials"),
    )
    axes.set_ylim(0.0, 37.0)
    axes.set_xlabel("diameter of the peg, hole 0.1 mm wider (mm)")
    axes.set_ylabel("time to cover 60 x 60 mm once (s)")


def _band(axes: Axes, studies: Sequence[Study]) -> None:
    """Draw the distance of detected passes from the band's centre against their speed."""
    _titled(axes, "Capture band", "off the middle the peg is over the hole for less time")
    passes = [each for study in studies for each in study.passes]
    if not passes:
        return
    dip = _typical(studies)
    speeds = np.linspace(0.001, 0.3, 300)
    half = [5e2 * dip.band(float(speed)) for speed in speeds]
    axes.fill_between(1e3 * speeds, half, 10.0, color=BEYOND, zorder=1)
    axes.plot(1e3 * speeds, half, "-", color=INK, lw=2, zorder=3)
    for study in studies:
        for is_noticed, marker in ((True, "o"), (False, "x")):
            of = [each for each in study.passes if each.is_noticed is is_noticed]
            x, y = [1e3 * each.speed for each in of], [1e3 * study.aside(each) for each in of]
            look: dict[str, Any] = (
                {"ms": 5.5, "alpha": 0.65, "mew": 0.0} if is_noticed else {"ms": 6.0, "alpha": 1.0, "mew": 1.6}
            )
            axes.plot(x, y, marker, color=colour_of(study), zorder=4, ls="none", **look)
    missed = [(study, each) for study in studies for each in study.passes if not each.is_noticed]
    within = sum(2.0 * study.aside(each) < dip.band(each.speed) for study, each in missed)
    axes.axhline(5e2 * dip.hole, color=GREY, ls="--", lw=1)
    _note(axes, (297.0, 5e2 * dip.hole + 0.2), "rim of the hole", GREY, "right")
    _style(
        axes,
        ("o", GREY, 0.0, f"noticed: {len(passes) - len(missed)} passes"),
        ("x", GREY, 0.0, f"missed: {len(missed)} passes, {within} within the bound"),
        ("-", INK, 2.0, f"bound: {1e3 * dip.depth:g} mm under {dip.push:g} N on {dip.mass:.1f} kg"),
    )
    axes.set_xlim(0.0, 300.0)
    axes.set_ylim(0.0, 5.9)
    axes.set_xlabel("speed over the rim (mm/s)")
    axes.set_ylabel("distance from the middle of the band (mm)")


def _fall(axes: Axes, stated: Sequence[Study]) -> None:
    """Draw the depth of drops against the time since the rim."""
    _titled(axes, "Fall", "the push against the hand's mass, until the far rim stops the peg")
    passes = [(study, each) for study in stated for each in study.passes if each.is_noticed]
    if not passes:
        return
    dip = _typical(stated)
    times = np.linspace(0.0, 0.08, 200)
    bound = [1e3 * fall_depth(float(time), dip.push, dip.mass) for time in times]
    axes.fill_between(1e3 * times, bound, 10.0, color=BEYOND, zorder=1)
    axes.plot(1e3 * times, bound, "-", color=INK, lw=2, zorder=5)
    for study, each in passes:
        x, y = [1e3 * time for time, _ in each.fall], [1e3 * depth for _, depth in each.fall]
        axes.plot(x, y, "-", color=colour_of(study), lw=1.0, alpha=0.55, zorder=4)
    axes.axhline(1e3 * dip.depth, color=GREY, ls="--", lw=1)
    _note(axes, (79.0, 1e3 * dip.depth - 0.09), "told as a fall", GREY, "right")
    _style(
        axes,
        ("-", INK, 2.0, f"bound: {dip.push:g} N on {dip.mass:.1f} kg"),
        ("-", GREY, 1.0, "falls that were noticed"),
        is_left=True,
    )
    axes.set_xlim(0.0, 80.0)
    axes.set_ylim(-0.1, 2.2)
    axes.set_xlabel("time since the lowest point passed the rim (ms)")
    axes.set_ylabel("depth of the lowest point (mm)")


def _turn(axes: Axes, studies: Sequence[Study]) -> None:
    """Draw the largest force of a rotation against its time."""
    _titled(axes, "Turn in the hole", "the wall bears what sets the arm turning about the peg's tip")
    turns = [each for study in studies for each in study.turns()]
    if not turns:
        return
    angle, coupling, push = (
        float(np.median([getattr(each, name) for each in turns])) for name in ("angle", "coupling", "push")
    )
    times = np.linspace(0.2, 3.2, 300)
    bound = [turn_force(float(time), angle, coupling, push) for time in times]
    axes.fill_between(times, 0.0, bound, color=BEYOND, zorder=1)
    axes.plot(times, bound, "-", color=INK, lw=2, zorder=3)
    for study in studies:
        of = study.turns()
        if not of:
            continue
        x, y = [each.time for each in of], [each.force for each in of]
        axes.plot(x, y, "o", color=colour_of(study), alpha=0.6, ms=6, mew=0.0, zorder=4)
        if not study.case.is_preset:
            _note(axes, (float(np.median(x)) + 0.1, max(y) + 0.9), study.case.label, GREEN)
    axes.axhline(OVER_FORCE, color=GREY, ls="--", lw=1)
    _note(axes, (3.15, OVER_FORCE + 0.6), f"{OVER_FORCE:g} N", GREY, "right")
    told = f"bound: {np.degrees(angle):.0f} degrees, {coupling:.1f} N for each rad/s²,\nand a push of {push:g} N"
    _style(axes, ("-", INK, 2.0, told), ("o", GREY, 0.0, "trials"))
    axes.set_xlim(0.2, 3.2)
    axes.set_ylim(0.0, 32.0)
    axes.set_xlabel("time of the turn (s)")
    axes.set_ylabel("largest force of peg and hole in it (N)")


def _down(axes: Axes, stated: Sequence[Study]) -> None:
    """Draw the depth of the downward motion against time."""
    _titled(axes, "Way down", "push, damping, and walls that wait until the hand is upright")
    for study in stated:
        colour, rows = colour_of(study), [row for row in study.good if row.way is not None]
        for row in rows:
            assert row.way is not None
            seen = np.array(row.way.scans)
            axes.plot(seen[:, 0], 1e3 * seen[:, 1], "-", color=colour, lw=0.8, alpha=0.45)
        if not rows:
            continue
        for walls, style in ((False, ":"), (True, "-")):
            way = _median_way([study.descent(row, walls=walls) for row in rows])
            axes.plot(way[0], 1e3 * way[1], style, color="white", lw=4.5, zorder=4)
            axes.plot(way[0], 1e3 * way[1], style, color=colour, lw=2.6, zorder=5)
    rows = [row for study in stated for row in study.good if row.way is not None]
    if rows:
        times, depths = _median_way([stated[0].descent(row, is_damped=False) for row in rows])
        axes.fill_betweenx(1e3 * depths, 0.0, times, color=BEYOND, zorder=1)
        axes.plot(times, 1e3 * depths, "-", color=INK, lw=2, zorder=5)
    _style(
        axes,
        ("-", INK, 2.0, "bound: push against inertia"),
        (":", GREY, 2.6, "and the damping of the law"),
        ("-", GREY, 2.6, "and walls, until the hand is upright"),
        ("-", GREY, 0.8, "trials"),
    )
    axes.set_xlim(0.0, 2.5)
    axes.set_ylim(20.8, 0.0)
    axes.set_xlabel("time since the turn ended (s)")
    axes.set_ylabel("depth of the peg in its hole (mm)")


def _median_way(ways: Sequence[tuple[Vector, Vector]]) -> tuple[Vector, Vector]:
    """Return the median time at which downward motions reach each depth, s, and the depths, m."""
    depths = np.linspace(max(float(way[1][0]) for way in ways), min(float(way[1][-1]) for way in ways), 200)
    # If walls hold a peg, its depth stays constant and the time of its next progress is used.
    return np.median(
        [np.interp(depths, deep + 1e-12 * np.arange(len(deep)), time) for time, deep in ways], axis=0
    ), depths


def _lean(axes: Axes, stated: Sequence[Study]) -> None:
    """Draw the tilt of a peg during its downward motion against its depth."""
    _titled(axes, "Jam", "pegs that stand still on their way down lean on both walls")
    if not stated:
        return
    peg, bore = stated[0].config.job().peg.part.thickness, stated[0].config.job().hole.part.thickness
    depths = np.linspace(0.2e-3, 0.0205, 400)
    most = np.degrees([allowed_tilt(float(depth), peg, bore) for depth in depths])
    axes.fill_between(1e3 * depths, most, 20.0, color=BEYOND, zorder=1)
    axes.plot(1e3 * depths, most, "-", color=INK, lw=2, zorder=3)
    counts = [0, 0]
    for study in stated:
        for place, (found, look) in enumerate(zip(study.scans(), LOOKS, strict=True)):
            counts[place] += len(found)
            if found:
                x, y = np.array(found).T
                axes.plot(1e3 * x, np.degrees(y), ".", color=(colour_of(study), JAMMED)[place], mew=0.0, **look)
    _style(
        axes,
        ("-", INK, 2.0, "bound: both walls touch"),
        (".", GREY, 0.0, f"on the way down: {counts[0]} scans"),
        (".", JAMMED, 0.0, f"slower than {1e3 * STILL:g} mm/s: {counts[1]} scans"),
    )
    axes.set_yscale("log")
    axes.set_yticks((0.1, 0.2, 0.5, 1, 2, 5), ("0.1", "0.2", "0.5", "1", "2", "5"))
    axes.set_yticks([], minor=True)
    axes.set_ylim(0.08, 7.9)
    axes.set_xlim(0.0, 20.5)
    axes.set_xlabel("depth of the peg in its hole (mm)")
    axes.set_ylabel("lean of the peg from the hole's axis (degrees)")


def _typical(studies: Sequence[Study]) -> Dip:
    """Return the conditions of a drop in the first case, for the median mass of all."""
    return studies[0].dip(float(np.median([each.mass for study in studies for each in study.passes])))


def _told(dip: Dip) -> str:
    return f"bound: {1e3 * dip.depth:g} mm deep under {dip.push:g} N, {dip.mass:.1f} kg"
