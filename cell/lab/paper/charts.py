"""The chart of the study of the published method: speed against accuracy."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from cell.lab.paper.measure import FIT, JUDGE, Candidate
from cell.lab.published import PUBLISHED_ATTEMPTS, PUBLISHED_SUCCESSES, PUBLISHED_TOTAL
from cell.plots import COLOURS
from cell.statistics import wilson

CHART = "paper.png"


def draw(candidates: Sequence[Candidate], title: str, folder: Path) -> Path:
    """Draw success against mean total time: every candidate on the first half, the judged ones, and Table I; return the file."""
    figure = Figure(figsize=(8.0, 5.5), layout="constrained")
    axes = figure.subplots()
    for half, colour, label in ((FIT, "#999999", "fitted half"), (JUDGE, COLOURS[0], "judged half")):
        for each in candidates:
            total = each.stages[-1]
            if each.half == half and total.attempts and total.time is not None:
                _point(axes, total.time, total.successes, total.attempts, colour, label)
                label = ""
                axes.annotate(each.name, (total.time, 100 * total.successes / total.attempts), fontsize=7)
    _point(axes, PUBLISHED_TOTAL, PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS, COLOURS[1], "[gibbons], Table I")
    axes.set_xlabel("mean total time of successes (s)")
    axes.set_ylabel("success (%), Wilson 95 % interval")
    axes.set_ylim(0.0, 103.0)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right", fontsize=8)
    figure.suptitle(f"The published method under honest errors\n{title}", fontsize=9)
    path = folder / CHART
    figure.savefig(path, dpi=110)
    return path


def _point(axes, time: float, successes: int, attempts: int, colour: str, label: str) -> None:  # type: ignore[no-untyped-def]
    """Draw one rate with its interval."""
    rate, (low, high) = successes / attempts, wilson(successes, attempts)
    bounds = [[100 * (rate - low)], [100 * (high - rate)]]
    axes.errorbar([time], [100 * rate], yerr=bounds, fmt="o", color=colour, markersize=5, label=label or None)
