"""Chart of the margins of each error."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cell.lab.charts import Curve, Panel, draw_panels
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
    height, curves = 0.8 / len(methods), []
    for number, method in enumerate(methods):
        colour = METHODS[method].colour
        curves.append(Curve([], [], colour, method, "o"))
        for row, error in enumerate(order):
            place = row + 0.4 - height * (number + 0.5)
            line, half = at[method, error, 0.9], at[method, error, 0.5]
            is_open = bool(line.margin) and math.isnan(line.fails)
            bar = [0.97, max(line.margin, 1.0)], [place, place]
            curves.append(Curve(*bar, colour, "", "-", 15.0 * height, 0.85))
            curves.append(Curve([line.margin * 1.04] if is_open else [], [place] if is_open else [], colour, "", ">"))
            if half.margin > line.margin:
                curves.append(Curve([half.margin], [place], colour, "", "o", is_hollow=True))
    panel = Panel(
        "",
        "hardest level with 90 % success over the honest level (ring: with 50 %; arrow: range ends first)",
        "",
        curves,
        "x",
        x_ticks=(1, 1.4, 2, 3, 4, 6, 8, 12, 16),
        y_ticks=range(len(order)),
        y_names=order,
    )
    return draw_panels([panel], title, path, height=0.5 + 0.36 * len(order), width=9.0)
