"""Chart of the margins of each error."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from cell.lab.charts import GREY
from cell.lab.frontier.methods import METHODS


@dataclass(frozen=True, slots=True)
class ErrorMargin:
    """Levels of one error between which one method falls to a share of successes; NaN where there is none."""

    method: str
    error: str
    share: float
    holds: float
    """Hardest level with at least this share of successes; NaN if the honest level has fewer."""
    fails: float
    """Next level, with fewer; NaN if every level holds."""
    margin: float
    """`holds` over the honest level, or the reverse if harder levels are smaller, >= 1; 0 without `holds`."""
    size: str
    """Size of the error at `holds`, in words."""
    seen: str
    """Successes of the trials at both levels."""


def draw(margins: Sequence[ErrorMargin], title: str, path: Path) -> Path:
    """Draw the margin of each error at 90 % as a bar and at 50 % as a ring, the least at the top; return the file."""
    at = {(line.method, line.error, line.share): line for line in margins}
    methods = list(dict.fromkeys(line.method for line in margins))
    order = sorted({line.error for line in margins}, key=lambda error: -at[methods[0], error, 0.9].margin)
    figure = Figure(figsize=(9.0, 1.6 + 0.36 * len(order)), layout="constrained")
    axes = figure.add_subplot()
    height = 0.8 / len(methods)
    for number, method in enumerate(methods):
        colour = METHODS[method].colour
        for row, error in enumerate(order):
            place = row + 0.4 - height * (number + 0.5)
            line, half = at[method, error, 0.9], at[method, error, 0.5]
            axes.barh(place, max(line.margin, 1.0) - 0.97, height, 0.97, color=colour, alpha=0.85)
            if line.margin and math.isnan(line.fails):
                axes.plot(line.margin * 1.04, place, ">", color=colour, ms=5)
            if half.margin > line.margin:
                axes.plot(half.margin, place, "o", mfc="none", color=colour, ms=5)
        axes.bar(0, 0, color=colour, label=method)
    axes.set_xscale("log")
    ticks = [1, 1.4, 2, 3, 4, 6, 8, 12, 16]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_yticks(range(len(order)), order, fontsize=9)
    axes.set_xlabel("hardest level with 90 % success over the honest level (ring: with 50 %; arrow: range ends first)")
    axes.grid(axis="x", alpha=0.25)
    axes.legend(loc="lower right", fontsize=9)
    axes.set_title(title, fontsize=9, color=GREY)
    figure.savefig(path, dpi=130)
    return path
