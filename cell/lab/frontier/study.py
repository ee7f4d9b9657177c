"""`cell study frontier`: speed against accuracy, one curve over the speed for each method, and the errors that explain it."""

import argparse
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from cell.lab.arguments import load_simulated, seeds_of
from cell.lab.charts import INK, Curve, Panel, draw_panels
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
"""Methods named in the title of the chart."""


def success(line: VariantLine) -> float:
    """Return the share of successes, %."""
    return 100.0 * line.successes / line.trials


Rows = Sequence[tuple[str, Callable[[VariantLine], float]]]
SUCCESS: Rows = (("success (%), bars: 95 % interval", success),)
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
        for rows, title, suffix in ((SUCCESS, finding(lines, scenes), ""), (ERRORS, errors, "_errors")):
            panels = [_panel(lines, scene, name, value, rows is SUCCESS) for name, value in rows for scene in scenes]
            path, titled = folder / f"{chart}{suffix}.png", f"{title}\n{conditions}"
            files.append(draw_panels(panels, titled, path, across=len(scenes), legend=3 * len(scenes)))
    return files


def _panel(
    lines: Sequence[VariantLine], scene: str, name: str, value: Callable[[VariantLine], float], is_success: bool
) -> Panel:
    """Return the panel of one quantity of all methods in a scene against time; the success has the presets and the real insertions, too."""
    curves = [curve for method in METHODS for curve in _curves(lines, method, scene, value)]
    if is_success:
        curves += [mark for method in METHODS for mark in _marks(lines, method, scene)]
        if scene == next(iter(SCENES)):
            low, high = (100.0 * end for end in wilson(PUBLISHED_TOTAL.successes, PUBLISHED_TOTAL.attempts))
            at = [PUBLISHED_TOTAL.time], [100.0 * PUBLISHED_TOTAL.successes / PUBLISHED_TOTAL.attempts]
            curves.append(Curve(*at, INK, "", "s", low=[low], high=[high], text="[gibbons], 40 real"))
    return Panel(
        scene,
        "mean time of the successes (s)",
        name,
        curves,
        "x",
        x_ticks=TIMES,
        x_limits=(TIMES[0], LONGEST),
        y_ticks=range(0, 101, 20) if is_success else (),
        y_limits=(-3.0, 118.0) if is_success else (0.0, None),
    )


def _curves(
    lines: Sequence[VariantLine], method: str, scene: str, value: Callable[[VariantLine], float]
) -> Iterator[Curve]:
    """Yield one quantity of a method against time, from slow to quick; the success has its 95 % interval, too.

    A point with at most 50 % success is hollow and not joined, because the mean time of few successes is uncertain. If a
    method has no success, the legend states its number of trials.
    """
    of = _swept(lines, method, scene)
    colour, inserted = METHODS[method].colour, [line for line in of if line.successes]
    joined = [line for line in inserted if success(line) > 50.0]
    bars = joined if value is success else []
    low, high = ([100.0 * getattr(line, end) for line in bars] for end in ("low", "high"))
    yield Curve(*_points(joined, value), colour, _label(method, of), "o-", low=low, high=high)
    apart = [line for line in inserted if line not in joined]
    yield Curve(*_points(apart, value), colour, "", "o", is_hollow=True)


def _swept(lines: Sequence[VariantLine], method: str, scene: str) -> list[VariantLine]:
    """Return the points of a method at every speed, without its presets, from slow to quick."""
    return sorted((line for line in _of(lines, method, scene) if _scale(line)), key=_scale)


def _points(lines: Sequence[VariantLine], value: Callable[[VariantLine], float]) -> tuple[list[float], list[float]]:
    return [line.mean for line in lines], [value(line) for line in lines]


def _label(method: str, of: Sequence[VariantLine]) -> str:
    """Return the label of a method's curve: empty without points; if no trial succeeded, with the count, as no point is drawn."""
    if not of:
        return ""
    return method if any(line.successes for line in of) else f"{method}: 0 of {sum(line.trials for line in of)}"


def _marks(lines: Sequence[VariantLine], method: str, scene: str) -> Iterator[Curve]:
    """Yield the presets of a method."""
    of = [line for line in _of(lines, method, scene) if line.variant in METHODS[method].points]
    for step, line in enumerate(sorted(of, key=lambda line: line.mean)):
        text = line.variant + step * "\n"  # neighbours would overlap
        yield Curve([line.mean], [success(line)], METHODS[method].colour, "", "D", 2.0, text=text)


def _of(lines: Sequence[VariantLine], method: str, scene: str) -> list[VariantLine]:
    return [line for line in lines if line.family == family(method, scene) and line.trials]


def finding(lines: Sequence[VariantLine], scenes: Sequence[str]) -> str:
    """Return the finding in one sentence: the least mean time with `SURE` inserted, or the best success."""
    told = []
    for scene in scenes:
        parts = [f"{method} {text}" for method in TITLED if (text := _quickest(_of(lines, method, scene)))]
        told += [f"{scene}: {', '.join(parts)}"] if parts else []
    return f"Least mean time to insert {100 * SURE:.0f} % - " + ";\n".join(told)


def _quickest(lines: Sequence[VariantLine]) -> str:
    shares = {line.mean: line.successes / line.trials for line in lines}
    sure = [time for time, share in shares.items() if share >= SURE]
    return f"{min(sure):.1f} s" if sure else f"not reached ({100 * max(shares.values()):.0f} %)" if shares else ""


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
