"""Chart of the study of learning: time and success by part number."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from cell.film.plots import COLOURS
from cell.lab.learning.measure import Mode, PartRow
from cell.records.statistics import wilson
from skills.contract import Outcome

CHART = "learning.png"


def draw(rows: Sequence[PartRow], parts: int, title: str, folder: Path) -> Path:
    """Draw mean search and total time of successes by part number, and each mode's success against its mean time; return the file."""
    figure = Figure(figsize=(12.5, 4.2), layout="constrained")
    search, total, both = figure.subplots(1, 3, width_ratios=(2, 2, 1))
    for mode, colour in zip(Mode, COLOURS, strict=False):
        of = [row for row in rows if row.mode == mode]
        good = [row for row in of if row.outcome == Outcome.SUCCESS]
        numbers = sorted({row.part for row in good})
        for axes, name in ((search, "search_time"), (total, "total_time")):
            means = [np.mean([getattr(row, name) for row in good if row.part == number]) for number in numbers]
            axes.plot(numbers, means, "o-", color=colour, markersize=3, label=f"the cell {mode}")
        low, high = (100 * bound for bound in wilson(len(good), len(of)))
        rate = 100 * len(good) / max(len(of), 1)
        if good:
            mean = float(np.mean([row.total_time for row in good]))
            both.errorbar([mean], [rate], yerr=[[rate - low], [high - rate]], fmt="o", color=colour)
    for axes, name in ((search, "search"), (total, "search, insertion and adjustment")):
        axes.axvline(parts + 0.5, color="#888888", linestyle="--", linewidth=0.8)
        axes.set_xlabel("number of the part; dashed: another fixture")
        axes.set_ylabel(f"mean time of {name} (s)")
        axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.3)
    both.set_xlabel("mean total time (s)")
    both.set_ylabel("success (%), Wilson 95 % interval")
    both.grid(alpha=0.3)
    search.legend(fontsize=8)
    figure.suptitle(title, fontsize=9)
    path = folder / CHART
    figure.savefig(path, dpi=110)
    return path
