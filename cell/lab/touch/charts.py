"""Chart of the study of the value of touch: speed against accuracy with and without measured theta."""

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from cell.film.plots import COLOURS
from cell.lab.touch.measure import SIGHTS, TouchLine

CHART = "touch.png"


def draw(lines: Sequence[TouchLine], title: str, folder: Path) -> Path:
    """Draw a panel for each hand with a marker for each sight: success with its Wilson interval against mean time; return the file."""
    hands = list(dict.fromkeys(line.hand for line in lines))
    figure = Figure(figsize=(2.0 + 3.1 * len(hands), 4.2), layout="constrained")
    panels = figure.subplots(1, len(hands), sharey=True, squeeze=False).ravel()
    for axes, hand in zip(panels, hands, strict=True):
        for sight, colour in zip(SIGHTS, COLOURS, strict=False):
            for of in (
                line.result for line in lines if (line.hand, line.sight) == (hand, sight) and line.result.trials
            ):
                rate, time = 100 * of.successes / of.trials, 0.0 if math.isnan(of.mean) else of.mean
                bounds = [[rate - 100 * of.low], [100 * of.high - rate]]
                axes.errorbar([time], [rate], yerr=bounds, fmt="o" if of.successes else "x", color=colour, label=sight)
        axes.set_title(hand, fontsize=10)
        axes.set_xlabel("mean total time of successes (s)")
        axes.set_xlim(left=0.0)
        axes.set_ylim(-2.0, 102.0)
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("success (%), Wilson 95 % interval")
    panels[0].legend(fontsize=8, loc="lower left")
    figure.suptitle(f"What touch is worth; a cross at 0 s: no success\n{title}", fontsize=9)
    path = folder / CHART
    figure.savefig(path, dpi=110)
    return path
