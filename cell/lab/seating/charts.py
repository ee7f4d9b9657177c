"""Picture of the study of seating without a switch: force against depth, seated and not."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from cell.film.plots import COLOURS
from cell.lab.seating.measure import CASES, LATCHES, Curves
from skills.latch_likelihood import resistance

CHART = "seating.png"
SHOWN = 6
"""Largest number of curves of one case."""


def draw(curves: Sequence[Curves], title: str, folder: Path) -> Path:
    """Draw the curves of the first trials of every case, a panel for each kind of latch; return the file."""
    kinds = list(dict.fromkeys(curve.kind for curve in curves))
    figure = Figure(figsize=(1.0 + 5.5 * len(kinds), 4.6), layout="constrained")
    panels = figure.subplots(1, len(kinds), sharey=True, squeeze=False).ravel()
    for axes, kind in zip(panels, kinds, strict=True):
        latch = LATCHES[kind]
        # True seatings are drawn above the others.
        for case, colour in zip(CASES[::-1], COLOURS[1 : len(CASES)] + COLOURS[-1:], strict=True):
            own = [curve for curve in curves if (curve.kind, curve.case) == (kind, case.name) and curve.heights]
            for curve, label in zip(own[:SHOWN], (case.name, *[None] * SHOWN), strict=False):
                axes.plot(
                    1e3 * np.array(curve.heights),
                    curve.forces,
                    color=colour,
                    alpha=0.8,
                    lw=1.6 if case.is_seated else 0.8,
                    label=label,
                )
        above = np.linspace(0.0, 1.5 * latch.height, 200)
        axes.plot(1e3 * above, resistance(above, latch), "k--", lw=1.5, label="latch as stated")
        axes.set_title(f"{kind}, {latch.force:g} N over {1e3 * latch.height:g} mm", fontsize=10)
        axes.set_xlabel("height of the hand above where the peg rests (mm)")
        axes.invert_xaxis()
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    panels[0].set_ylabel("force on the hand along z, as the arm reports it (N)")
    figure.suptitle(f"Force against depth, up to {SHOWN} trials of each case\n{title}", fontsize=9)
    path = folder / CHART
    figure.savefig(path, dpi=110)
    return path
