"""The chart, the map and the tables of the ladder of models."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, NullFormatter

from cell.film.plots import COLOURS
from cell.lab.contact import measure as contact
from cell.lab.contact.boundaries import boundary_bouncing, boundary_bound
from cell.lab.contact.ladder import SHIPPED
from cell.lab.contact.measure import Findings, RungRow, verdict
from cell.records.provenance import versions
from drivers.quantities import Vector
from sim.truth import VOID_PENETRATION

CHART, MAP = "contact.png", "integration.png"
FAMILIES = {
    "closed form": ("o", COLOURS[5]),
    "closed form, touching only": ("D", COLOURS[6]),
    "turning flats, legacy CCD": ("^", COLOURS[3]),
    "turning flats, native CCD": ("v", COLOURS[4]),
    "ring of boxes, legacy CCD": ("s", COLOURS[1]),
    "ring of boxes, native CCD": ("P", COLOURS[2]),
    "softer contacts": ("X", "#777777"),
}
LOWEST, HIGHEST = 0.02, 1000.0
"""Ends of the axis of errors, %."""
VERDICTS = {"holds": "#b7dfb9", "penetrates": "#f6d98b", "unstable": "#e58f8f"}


def draw(found: Findings, folder: Path) -> list[Path]:
    """Draw chart and map; return their files."""
    _chart(found, folder / CHART)
    _map(found, folder / MAP)
    return [folder / CHART, folder / MAP]


def _chart(found: Findings, path: Path) -> None:
    figure = Figure(figsize=(13, 8.2), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(8, 5))
    _draw_ladder(left, found)
    _draw_hands(right, found)
    figure.suptitle("Models of the contact: speed against exactness", fontsize=14)
    figure.supxlabel(_footer(), fontsize=8)
    figure.savefig(path, dpi=130)


def _draw_ladder(axes: Axes, found: Findings) -> None:
    rows, longest_step = found.rungs, found.longest_step
    axes.axhspan(LOWEST / 2, 100 * contact.EXACT_ENOUGH, color="#b7dfb9", alpha=0.35, lw=0)
    axes.axhline(100 * contact.EXACT_ENOUGH, color="#228833", lw=0.8)
    for row in rows:
        if math.isfinite(row.real_time):
            _draw_rung(axes, row, longest_step)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(LOWEST / 1.4, HIGHEST * 1.6)
    _plain_ticks(axes, (10, 20, 50, 100, 200, 500))
    axes.set_xlabel("bare physics, multiples of real time on one core")
    axes.set_ylabel("worst error to the exact depth over 1, 2, 5, 15, 45 degrees (%)")
    pushes = min((row.pushes for row in rows if row.pushes), default=0)
    axes.set_title(
        f"Model of the hole: {found.parts}, 10 N, rigid mover; {len(rows)} models, n = {pushes} pushes each",
        fontsize=10,
    )
    axes.grid(alpha=0.3, which="both", lw=0.4)
    handles = _ladder_legend({row.family for row in rows}, longest_step)
    axes.legend(handles=handles, fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=3, frameon=False)
    axes.annotate(
        "numbers: boxes of the ring, at 0.5 ms; 1000 % or more: fell through; 100 %: stuck on top",
        (0.01, 0.01),
        xycoords="axes fraction",
        fontsize=7,
    )


def _draw_rung(axes: Axes, row: RungRow, longest_step: float) -> None:
    """Draw one rung of the ladder: its marker, a sign for each failed gate, and its name if it has one."""
    marker, colour = FAMILIES.get(row.family, ("o", "#000000"))
    y = min(max(100 * row.error, LOWEST), HIGHEST)
    size = 5 + 3 * math.log2(max(row.timestep / 2.5e-4, 1.0))
    is_good = verdict(row) == "good" and row.timestep <= longest_step
    axes.plot(row.real_time, y, marker, ms=size, color=colour, mfc=colour if is_good else "none", mew=1.3, zorder=3)
    for fails, sign, wider, edge, width in (
        (row.is_void, "x", 5, "#222222", 1.0),
        (not row.rests, "_", 9, "#cc2222", 1.5),
        (row.timestep > longest_step, "|", 9, "#222222", 1.5),
    ):
        if fails:
            axes.plot(row.real_time, y, sign, ms=size + wider, color=edge, mew=width, zorder=4)
    if row.name == SHIPPED:
        axes.annotate(
            "shipped",
            (row.real_time, y),
            xytext=(10, -14),
            textcoords="offset points",
            fontsize=10,
            weight="bold",
            arrowprops={"arrowstyle": "-", "lw": 0.8},
        )
    elif "boxes" in row.name and row.timestep == 5e-4 and row.family != "softer contacts":
        boxes = row.name.split()[0]
        axes.annotate(boxes, (row.real_time, y), xytext=(6, 4), textcoords="offset points", fontsize=7, color=colour)


def _ladder_legend(present: set[str], longest_step: float) -> list[Line2D]:
    """Return legend entries of the families present, the signs of failed gates, and the sizes."""
    families = [(marker, colour, name) for name, (marker, colour) in FAMILIES.items() if name in present]
    void = f"void: over {1e6 * VOID_PENETRATION:.0f} um in the bore for 2 ms"
    outrun = f"step over {1e3 * longest_step:.2f} ms: the grip outruns the contacts"
    return [
        *(Line2D([], [], ls="", marker=marker, color=colour, label=name) for marker, colour, name in families),
        Line2D([], [], ls="", marker="o", mfc="none", color="#222222", label="fails a gate"),
        Line2D([], [], ls="", marker="x", color="#222222", label=void),
        Line2D([], [], ls="", marker="_", color="#cc2222", ms=12, label="never rests"),
        Line2D([], [], ls="", marker="|", color="#222222", ms=12, label=outrun),
        Line2D([], [], ls="", marker="o", color="#222222", ms=5, label="step 0.25 ms"),
        Line2D([], [], ls="", marker="o", color="#222222", ms=11, label="step 1 ms (size grows with the step)"),
    ]


def _draw_hands(axes: Axes, found: Findings) -> None:
    axes.axhspan(LOWEST / 2, 100 * contact.EXACT_ENOUGH, color="#b7dfb9", alpha=0.35, lw=0)
    for row, colour, marker in zip(found.hands, (COLOURS[1], COLOURS[3], COLOURS[5], COLOURS[6]), "sD^v", strict=False):
        label = f"{row.name}: the tip stays {1e3 * row.left:.1f} mm off"
        if not math.isfinite(row.real_time):
            axes.plot([], [], marker, color=colour, mfc="none", label=f"{row.name}: {row.fault}")
            continue
        y = min(max(100 * abs(row.error), LOWEST), HIGHEST)
        axes.plot(row.real_time, y, marker, ms=10, color=colour, label=label)
        if row.penetration > VOID_PENETRATION:
            axes.plot(row.real_time, y, "x", ms=16, color="#222222")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(LOWEST / 1.4, HIGHEST * 1.6)
    _plain_ticks(axes, (10, 20, 30, 50, 70, 100, 200))
    axes.set_xlabel("physics and torque law, multiples of real time on one core")
    axes.set_ylabel("error to the exact depth at the peg's own tilt (%)")
    axes.set_title("Arm and grip, hole in closed form, n = 2 pushes each", fontsize=10)
    axes.grid(alpha=0.3, which="both", lw=0.4)
    axes.legend(
        fontsize=8,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.09),
        frameon=False,
        markerscale=0.7,
        title="with a step of 5 mm in the air:",
        title_fontsize=8,
    )


def _plain_ticks(axes: Axes, speeds: Sequence[float]) -> None:
    """Label both axes with plain numbers; the axis of speeds at those `speeds` that it shows."""
    low, high = axes.get_xlim()
    axes.set_xlim(0.85 * low, 1.15 * high)
    axes.set_xticks([speed for speed in speeds if 0.85 * low <= speed <= 1.15 * high])
    axes.xaxis.set_minor_formatter(NullFormatter())
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _map(found: Findings, path: Path) -> None:
    rows = found.integration
    figure = Figure(figsize=(12, 5.6), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    titles = {"exact": "contacts ahead of touch (shipped)", "unpredicted": "contacts only while touching"}
    for axes, (hole, title) in zip(panels, titles.items(), strict=True):
        here = [row for row in rows if row.hole == hole]
        steps, stiffnesses = (sorted({getattr(row, name) for row in here}) for name in ("timestep", "stiffness"))
        grid = np.full((len(stiffnesses), len(steps)), np.nan)
        for row in here:
            grid[stiffnesses.index(row.stiffness), steps.index(row.timestep)] = list(VERDICTS).index(row.verdict)
        axes.pcolormesh(
            1e3 * _edges(steps),
            _edges(stiffnesses),
            grid,
            cmap=ListedColormap(list(VERDICTS.values())),
            vmin=-0.5,
            vmax=2.5,
            edgecolors="#ffffff",
            linewidth=0.3,
        )
        fine = np.geomspace(steps[0], steps[-1], 100)
        axes.plot(
            1e3 * fine,
            [boundary_bound(t) for t in fine],
            "k-",
            lw=1.8,
            label=r"theory, bound: $k\,dt^2 + 2\,b\,dt = 4$",
        )
        axes.plot(
            1e3 * fine,
            [boundary_bouncing(t) for t in fine],
            "k--",
            lw=1.5,
            label=r"theory, bouncing: $k\,dt^2 + b\,dt = 2$",
        )
        axes.plot(1e3 * fine, 1.0 / (2.0 * fine) ** 2, "b:", lw=1.5, label="stiffest standard form: 2 steps")
        if hole == "exact":
            axes.plot([0.5], [1.0 / (2.0 * 5e-4) ** 2], "bo", ms=7, label="shipped")
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlim(1e3 * _edges(steps)[0], 1e3 * _edges(steps)[-1])
        axes.set_ylim(_edges(stiffnesses)[0], _edges(stiffnesses)[-1])
        axes.set_xlabel("time step (ms)")
        axes.set_title(f"{title}; n = {len(here)} points", fontsize=10)
        handles, _ = axes.get_legend_handles_labels()
        patches = [Patch(color=colour, label=name) for name, colour in VERDICTS.items()]
        axes.legend(handles=[*patches, *handles], fontsize=8, loc="lower left", framealpha=0.92)
    panels[0].set_ylabel("stiffness of the contact, k (1/s²), with b = 2 sqrt(k)")
    figure.suptitle(f"Where integration fails: {found.parts}, at 5 degrees, pushed with 10 N", fontsize=13)
    figure.supxlabel(_footer(), fontsize=8)
    figure.savefig(path, dpi=130)


def _edges(values: Sequence[float]) -> Vector:
    """Return the edges of cells around values with even spacing in the logarithm."""
    logs = np.log(values)
    middles = (logs[:-1] + logs[1:]) / 2
    edges: Vector = np.exp(np.concatenate([[2 * logs[0] - middles[0]], middles, [2 * logs[-1] - middles[-1]]]))
    return edges


def _footer() -> str:
    packages = ", ".join(
        f"{name} {version}" for name, version in versions().items() if name in ("mujoco", "numpy", "numba", "code")
    )
    return f"cell study contact; {packages}"
