"""Chart of the campaign."""

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from cell.film.plots import COLOURS
from cell.lab.faults.cases import FaultCase
from cell.lab.faults.tables import REST_AFTER_LIMIT

CHART = "faults.png"


def draw(rows: Sequence[FaultCase], path: Path) -> None:
    """Draw the time from each fault to rest against the largest force after the fault, by the faulty component."""
    figure = Figure(figsize=(7.5, 5), layout="constrained")
    axes = figure.add_subplot()
    groups = list(dict.fromkeys(row.kind.split(":")[0] for row in rows))
    for group, colour in zip(groups, COLOURS * 2, strict=False):
        cases = [row for row in rows if row.kind.startswith(f"{group}:") and math.isfinite(row.rest_after)]
        label = f"{group}: {len(cases)}"
        axes.plot([row.rest_after for row in cases], [row.peak_force for row in cases], "o", color=colour, label=label)
    axes.axvline(REST_AFTER_LIMIT, color="#222222", linestyle="--", linewidth=1)
    axes.set_xlabel("from the fault to the arm's last motion (s)")
    axes.set_ylabel("largest force from the fault on (N)")
    axes.set_title(f"Faults in the middle of an insertion, n = {len(rows)}; the line is the limit")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=9)
    figure.savefig(path, dpi=110)
