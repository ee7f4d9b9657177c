"""`cell study frontier`: speed against accuracy, one curve over the speed for each method, and the errors that explain it."""

import argparse
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from cell.lab.arguments import load_simulated, seeds_of
from cell.lab.charts import GREY, INK, Curve, Panel, draw_panels
from cell.lab.compare import VariantLine, compared
from cell.lab.frontier.methods import LONGEST, METHODS, QUICK, SCALES, SCENES, TEST, family, variants
from cell.lab.published import PUBLISHED_TOTAL
from cell.lab.report import StudyReport, reported
from cell.lab.tables import Columns, table
from cell.records.statistics import wilson

TABLE = "frontier.csv"
TIMES = (3, 4, 5, 6, 8, 10, 15, 20, 30, 40, 60, 80, 120)
"""Ticks of the logarithmic time axis, s."""
SURE = 0.9
"""Share of successes that counts as sure, fraction."""
TITLED = "shipped", "theta frozen after the grasp", "force alone"
"""Methods named in the title of a panel."""
FINDING = f"Least mean time in which a method inserts {100 * SURE:.0f} % of the pegs"
"""Title of the chart; the panels' titles have the figures."""
STYLES = (
    Curve([], [], GREY, "faster than tuned", "--"),
    Curve([], [], GREY, "at most 50 %", "o", is_hollow=True),
)
"""Entries of the legend for the styles that all methods share."""


def success(line: VariantLine) -> float:
    """Return the share of successes, %."""
    return 100.0 * line.successes / line.trials


Rows = Sequence[tuple[str, Callable[[VariantLine], float]]]
SUCCESS: Rows = (("success (%), band: 95 % interval", success),)
ERRORS: Rows = (
    ("error of theta (degrees)", lambda line: math.degrees(line.theta)),
    ("error of the tip (mm)", lambda line: 1e3 * line.tip),
    ("largest force (N)", lambda line: line.force_median),
)
"""Rows of the two charts: name and value. The errors are medians over all trials of a point."""
POINTS: Columns = {
    "speed": lambda line: line.variant,
    "success": lambda line: f"{line.successes}/{line.trials}",
    "95 % interval": lambda line: f"{100 * line.low:.1f} to {100 * line.high:.1f} %",
    "mean (s)": lambda line: f"{line.mean:.2f}",
    "theta (degrees)": lambda line: f"{math.degrees(line.theta):.2f}",
    "tip (mm)": lambda line: f"{1e3 * line.tip:.2f}",
    "force (N)": lambda line: f"{line.force_median:.1f}",
    "endings other than success": lambda line: line.error or line.endings,
}
"""Columns of the printed table."""


def draw(lines: Sequence[VariantLine], conditions: str, folder: Path) -> list[Path]:
    """Draw the charts of the scenes that have lines into `folder`, success and errors against time; return their files."""
    shown = {name: scene.chart for name, scene in SCENES.items() if any(_of(lines, each, name) for each in METHODS)}
    errors, files = "Errors and force: medians over all trials of a point", list[Path]()
    for chart in dict.fromkeys(shown.values()):
        scenes = [name for name in shown if shown[name] == chart]
        for rows, title, suffix in ((SUCCESS, FINDING, ""), (ERRORS, errors, "_errors")):
            panels = [_panel(lines, scene, name, value, rows is SUCCESS) for name, value in rows for scene in scenes]
            path, titled = folder / f"{chart}{suffix}.png", f"{title}\n{conditions}"
            files.append(draw_panels(panels, titled, path, across=len(scenes), legend=4 * len(scenes)))
    return files


def _panel(
    lines: Sequence[VariantLine], scene: str, name: str, value: Callable[[VariantLine], float], is_success: bool
) -> Panel:
    """Return the panel of one quantity of all methods in a scene against time; the success has the presets and the real insertions, too."""
    curves = [curve for method in METHODS for curve in _curves(lines, method, scene, value)] + list(STYLES)
    if is_success:
        curves += [mark for method in METHODS for mark in _marks(lines, method, scene)]
        if scene == next(iter(SCENES)):
            curves.append(_real())
    return Panel(
        finding(lines, scene) if is_success else scene,
        "mean time of the successes (s)",
        name,
        curves,
        "x",
        x_ticks=TIMES,
        x_limits=(TIMES[0], 1.1 * LONGEST),
        y_ticks=range(0, 101, 20) if is_success else (),
        y_limits=(-3.0, 118.0) if is_success else (0.0, None),
    )


def _real() -> Curve:
    """Return the published insertions of a real cell as one point with its 95 % interval."""
    low, high = (100.0 * end for end in wilson(PUBLISHED_TOTAL.successes, PUBLISHED_TOTAL.attempts))
    at = [PUBLISHED_TOTAL.time], [100.0 * PUBLISHED_TOTAL.successes / PUBLISHED_TOTAL.attempts]
    return Curve(*at, INK, "", "s", low=[low], high=[high], text="[gibbons], 40 real")


def _curves(
    lines: Sequence[VariantLine], method: str, scene: str, value: Callable[[VariantLine], float]
) -> Iterator[Curve]:
    """Yield one quantity of a method against time, from slow to quick; the success has its 95 % interval, too.

    The line is dashed above `speed_scale` 1. A point with at most 50 % success is hollow, because the mean time of few
    successes is uncertain. A point without any success has no time; it is at `LONGEST`.
    """
    of, colour = _swept(lines, method, scene), METHODS[method].colour
    sure = [line for line in of if success(line) > 50.0]
    if value is success:
        low, high = ([100.0 * getattr(line, end) for line in sure] for end in ("low", "high"))
        yield Curve(*_points(sure, value), colour, "", " ", low=low, high=high, is_band=True)
    for side, label, style in ((-1, method if of else "", "-"), (1, "", "--")):
        of_side = [line for line in of if line.successes and side * _scale(line) >= side]
        yield Curve(*_points(of_side, value), colour, label, style)
    yield Curve(*_points(sure, value), colour, "", "o")
    times, values = _points([line for line in of if line not in sure], value)
    yield Curve(np.nan_to_num(times, nan=LONGEST), values, colour, "", "o", is_hollow=True)


def _swept(lines: Sequence[VariantLine], method: str, scene: str) -> list[VariantLine]:
    """Return the points of a method at every speed, without its presets, from slow to quick."""
    return sorted((line for line in _of(lines, method, scene) if _scale(line)), key=_scale)


def _points(lines: Sequence[VariantLine], value: Callable[[VariantLine], float]) -> tuple[list[float], list[float]]:
    return [line.mean for line in lines], [value(line) for line in lines]


def _marks(lines: Sequence[VariantLine], method: str, scene: str) -> Iterator[Curve]:
    """Yield the presets of a method."""
    of = [line for line in _of(lines, method, scene) if line.variant in METHODS[method].points]
    for step, line in enumerate(sorted(of, key=lambda line: line.mean)):
        text = line.variant + step * "\n"  # neighbours would overlap
        yield Curve([line.mean], [success(line)], METHODS[method].colour, "", "D", 2.0, text=text)


def _of(lines: Sequence[VariantLine], method: str, scene: str) -> list[VariantLine]:
    return [line for line in lines if line.family == family(method, scene) and line.trials]


def finding(lines: Sequence[VariantLine], scene: str) -> str:
    """Return the least mean times in a scene with `SURE` inserted, or the best success, by method."""
    told = [f"{method} {text}" for method in TITLED if (text := _quickest(_of(lines, method, scene)))]
    return f"{scene}: {', '.join(told)}"


def _quickest(lines: Sequence[VariantLine]) -> str:
    shares = {line.mean: line.successes / line.trials for line in lines}
    sure = [time for time, share in shares.items() if share >= SURE]
    return f"{min(sure):.1f} s" if sure else f"never ({100 * max(shares.values()):.0f} %)" if shares else ""


def _scale(line: VariantLine) -> float:
    """Return the `speed_scale` of a point of a curve; 0 for a preset."""
    found = [text.split("=")[1] for text in line.sets.split() if text.startswith("speed_scale=")]
    return float(found[0]) if found else 0.0


def run(args: argparse.Namespace) -> StudyReport:
    """Run every point on the same seeds, write the table, draw the charts.

    Raises:
        ConfigError: A method or a scene is unknown.
    """
    load_simulated(args)
    tried = variants(args.method or tuple(METHODS), args.scene or tuple(SCENES), QUICK if args.quick else SCALES)
    found = compared(args, tried, seeds_of(args, 200), TABLE, TEST)
    shown = table(found.title, {"curve": lambda line: line.family}, POINTS, found.lines)
    charts = draw(found.lines, found.title, found.folder)
    return reported(shown, found.folder, {TABLE: found.lines}, charts, title=found.title, lines=found.lines)
