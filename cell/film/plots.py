"""Plots of one run from its samples, and of both fingers."""

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from cell.film.drawing import COLOURS
from cell.records.schema import RunRow
from drivers.errors import ConfigError
from drivers.quantities import FINGER_NAMES, FINGERS, TaxelFrame, Vector
from drivers.scene_facts import BRIGHT, NOISE, felt, touch_colours
from drivers.skin.layout import Layout, finger_positions
from skills.catalogue import ADJUST, INSERT, SEARCH


def plot_run(row: RunRow, samples: dict[str, Vector], path: Path, faults: Mapping[str, float]) -> None:
    """Draw one run: tip over the plate, angles, taxels with the hole event, forces, all by stage.

    Args:
        row: Row of the run.
        samples: Samples of the run.
        path: File of the picture.
        faults: Times of its faults on the cell's clock, s, by code.
    """
    figure = Figure(figsize=(13, 8), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(2, 3))
    plan = figure.add_subplot(grid[:, 0])
    time = samples["stamp"] - samples["stamp"][0] if samples["stamp"].size else samples["stamp"]
    stage = samples["stage"].astype(int)
    _draw_plan(plan, samples, stage)
    angles, taxels, forces = (figure.add_subplot(grid[place, 1]) for place in range(3))
    upright = np.hypot(samples["axis_x"], samples["axis_y"])
    angles.plot(time, np.degrees(samples["theta"]), label="theta, in the hand", color="#aa3377", lw=1)
    angles.plot(
        time, np.degrees(np.arctan2(upright, samples["axis_z"])), label="phi, to the vertical", color="#4477aa", lw=1
    )
    angles.set_ylabel("angle (degrees)")
    age = angles.twinx()
    known = np.where(np.isfinite(samples["theta_stamp"]), samples["stamp"] - samples["theta_stamp"], np.nan)
    age.plot(time, 1e3 * known, color="#bbbbbb", lw=0.5)
    age.set_ylabel("age of theta (ms), grey")
    age.set_ylim(0.0, 500.0)
    angles.set_zorder(age.get_zorder() + 1)
    angles.set_frame_on(False)
    taxels.plot(time, samples["taxels"].mean(axis=1), color="#222222", lw=1, label="average of all taxels")
    found = _hole_event(stage)
    if found is not None:
        taxels.axvline(time[found], color="#ee6677", lw=1.5, ls="--", label="hole event: the search ends")
    taxels.set_ylabel("pressure (counts)")
    size = np.sqrt(samples["force_x"] ** 2 + samples["force_y"] ** 2 + samples["force_z"] ** 2)
    forces.plot(time, size, color="#228833", lw=1, label="magnitude")
    forces.plot(time, samples["force_z"], color="#66ccee", lw=1, label="along z")
    forces.set_ylabel("external force (N)")
    forces.set_xlabel("time since the first scan (s)")
    for axes in (angles, taxels, forces):
        _shade_stages(axes, time, stage)
        for code, stamp in faults.items():
            axes.axvline(stamp - samples["stamp"][0], color="#bb4455", lw=1.5, label=f"fault {code}")
        axes.legend(loc="upper left", fontsize=8)
        axes.margins(x=0)
    ending = f"{row.outcome} {row.reason}".strip()
    figure.suptitle(f"Run {row.run}: {row.program}, {ending}, {row.started}")
    figure.savefig(path, dpi=110)


def draw_fingers(frame: TaxelFrame, layout: Layout, path: Path) -> None:
    """Save a picture of both fingers, with the number of each taxel; the tip of the hand points down.

    Raises:
        ConfigError: The file cannot be written.
    """
    figure = Figure(figsize=(8, 6), layout="constrained")
    places = finger_positions(layout) * 1e3
    scale = ListedColormap(touch_colours(felt(np.linspace(0.0, BRIGHT, 256))) / 255)
    for number, axes in enumerate(figure.subplots(1, FINGERS, sharex=True, sharey=True)):
        x, y = places[number].T
        good = frame.trusted[number]
        seen = {"c": frame.values[number][good], "cmap": scale, "vmin": 0.0, "vmax": BRIGHT}
        shown = axes.scatter(y[good], x[good], s=400, edgecolors="#888888", **seen)
        axes.scatter(y[~good], x[~good], marker="x", s=200, color="#ee6677")
        for taxel, place in enumerate(places[number]):
            axes.annotate(str(taxel), place[::-1], (0, -14), textcoords="offset points", ha="center", va="top", size=8)
        axes.set_title(f"{FINGER_NAMES[number]} finger, frame {frame.sequence}")
        axes.set_xlabel("y across the finger (mm)")
        axes.set_aspect("equal")
        axes.margins(0.15)
        if number == 0:
            axes.set_ylabel("x along the finger (mm)")
    axes.invert_yaxis()  # for both fingers: they share this axis
    noise = f"counts above the baseline, noise below {NOISE:g}; cross: not trusted"
    figure.colorbar(shown, ax=figure.axes, label=noise)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=110)
    except (OSError, ValueError) as error:
        raise ConfigError(f"--out {path}: cannot be written: {error}") from None


def _draw_plan(axes: Axes, samples: dict[str, Vector], stage: Vector) -> None:
    x, y = 1e3 * samples["tip_x"], 1e3 * samples["tip_y"]
    for skill in (SEARCH, INSERT, ADJUST):
        here = stage == skill.stage
        if here.any():
            # The plan omits the approach, because movements on the surface would be too small to read beside it.
            # Largest height above the tip's median height at which the plan shows the tip, m.
            here &= samples["tip_z"] < np.median(samples["tip_z"][here]) + 0.005
            axes.plot(x[here], y[here], lw=0.8, color=_colour(skill.stage), label=skill.name)
    found = _hole_event(stage)
    if found is not None:
        axes.plot(x[found], y[found], "x", color="#ee6677", ms=9, label="hole event")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x, base frame (mm)")
    axes.set_ylabel("y, base frame (mm)")
    axes.set_title("End point of the peg over the plate, as estimated")
    if axes.has_data():
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=4, fontsize=8)


def _shade_stages(axes: Axes, time: Vector, stage: Vector) -> None:
    if time.size == 0:
        return
    edges = [0, *(np.flatnonzero(np.diff(stage)) + 1), time.size]
    for first, last in pairwise(edges):
        axes.axvspan(time[first], time[last - 1], color=_colour(int(stage[first])), alpha=0.15, lw=0)


def _colour(stage: int) -> str:
    return COLOURS[stage % len(COLOURS)]


def _hole_event(stage: Vector) -> int | None:
    """Return the number of the last scan of the last search that an insertion followed; None if there is none."""
    found = np.flatnonzero((stage[:-1] == SEARCH.stage) & (stage[1:] == INSERT.stage))
    return int(found[-1]) if found.size else None
