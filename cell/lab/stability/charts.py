"""Stability map: the result of every gain, period and delay, with the theoretical boundary."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cell.config.margins import HELD
from cell.film.plots import COLOURS
from cell.lab.stability.measure import Boundary, Shipped, StepTrace
from cell.lab.stability.report import UNITS, StabilityReport
from cell.records.provenance import versions

STABLE, UNSTABLE, GUARD, THEORY = COLOURS[1], COLOURS[5], "#222222", COLOURS[3]
NAMED = ("mujoco", "numpy", "numba", "code")
"""Packages whose versions appear on a chart."""
LATE = {0: "at once", 1: "one period late"}
OBSERVER = {
    False: "observer off: the error is held from frame to frame",
    True: "observer on: only theta is as old as the frame",
}


def draw(found: StabilityReport, folder: Path) -> list[Path]:
    """Draw the maps of translation and of rotation into `folder`, and return the files."""
    named = ", ".join(f"{name} {versions()[name]}" for name in NAMED)
    files = [folder / f"stability_{kind}.png" for kind in HELD]
    for kind, path in zip(HELD, files, strict=True):
        draw_map(kind, found.traces, found.theory, found.shipped, named, path)
    return files


def draw_map(
    kind: str,
    traces: Sequence[StepTrace],
    theory: Sequence[Boundary],
    shipped: Sequence[Shipped],
    versions: str,
    path: Path,
) -> None:
    """Draw the map of translation or of rotation: delays side by side, the observer off above and on below."""
    traces = [trace for trace in traces if trace.case.kind == kind]
    theory = [line for line in theory if line.kind == kind]
    delays = sorted({trace.case.delay for trace in traces})
    figure = Figure(figsize=(3.6 * len(delays) + 1.2, 8.2), layout="constrained")
    grid = figure.subplots(2, len(delays), sharex=True, sharey=True, squeeze=False)
    for row, observer in zip(grid, (False, True), strict=True):
        for axes, delay in zip(row, delays, strict=True):
            here = [t for t in traces if t.case.observer is observer and t.case.delay == delay]
            _mark(axes, here)
            if not observer:
                line = sorted((b.period, b.gain) for b in theory if b.delay == delay)
                axes.plot([1e3 * p for p, _ in line], [g for _, g in line], color=THEORY, lw=1.8)
            for point in shipped:
                if delay == 0 and point.kind == kind:
                    axes.plot(1e3 * point.period, point.gain, "*", color=COLOURS[4], mec="#222222", ms=13, zorder=4)
            axes.set_title(f"frames used {LATE.get(delay, f'{delay} periods late')}", fontsize=10)
    for axes in grid[-1]:
        axes.set_xlabel("period of the skin (ms)")
    for axes, observer in zip(grid[:, 0], (False, True), strict=True):
        axes.set_ylabel(f"{OBSERVER[observer]}\ngain in {kind} ({UNITS[kind]})")
    first = grid[0, 0]
    periods = sorted({1e3 * t.case.period for t in traces})
    gains = sorted({t.case.gain for t in traces})
    first.set(
        xscale="log", yscale="log", xlim=(periods[0] / 1.4, periods[-1] * 1.4), ylim=(gains[0] / 2, gains[-1] * 2)
    )
    first.set_xticks(periods, [f"{p:g}" for p in periods])
    first.minorticks_off()
    figure.legend(handles=_legend(), loc="outside lower center", ncols=3, fontsize=9)
    figure.suptitle(
        f"Stability in {kind} on the whole simulated arm, n = {len(traces)}, one run a point\n{versions}", fontsize=11
    )
    figure.savefig(path, dpi=110)


def _mark(axes: Axes, traces: Sequence[StepTrace]) -> None:
    for trace in traces:
        x, y = 1e3 * trace.case.period, trace.case.gain
        if trace.is_stable:
            axes.plot(x, y, "o", mfc="none", mec=STABLE, ms=6)
        else:
            axes.plot(x, y, "x", color=UNSTABLE, ms=7, mew=1.8)
        if trace.stopped_at is not None:
            axes.plot(x, y, "s", mfc="none", mec=GUARD, ms=12)
        elif trace.softened_at is not None:
            axes.plot(x, y, "D", mfc="none", mec=GUARD, ms=12)
    axes.grid(alpha=0.25, which="both")


def _legend() -> list[Line2D]:
    def mark(marker: str, label: str, face: str, edge: str, size: float) -> Line2D:
        return Line2D([], [], ls="", marker=marker, mfc=face, mec=edge, color=edge, ms=size, label=label)

    return [
        mark("o", "stable", "none", STABLE, 6),
        mark("x", "unstable", UNSTABLE, UNSTABLE, 7),
        mark("*", "shipped gains", COLOURS[4], "#222222", 13),
        mark("s", "stopped by the guard", "none", GUARD, 12),
        mark("D", "softened by it", "none", GUARD, 12),
        Line2D([], [], color=THEORY, lw=1.8, label="boundary of theory, the arm's own inertia"),
    ]
