"""Table of the study of the value of touch."""

import math
from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from cell.lab.touch.measure import TouchLine


def touch(lines: Sequence[TouchLine], title: str) -> Table:
    """Return success, time, force and in-hand rotation of every hand with every sight."""
    caption = "times are of the successes, s; forces are each trial's largest, N; turns of the peg in the hand, degrees"
    table = Table(title=title, caption=caption)
    for name in ("hand", "theta", "success", "Wilson 95 %", "mean", "p95", "force median", "turn median", "turn p95"):
        table.add_column(name, justify="left" if name in ("hand", "theta") else "right")
    table.add_column("endings other than success")
    for before, line in zip((None, *lines), lines, strict=False):
        of = line.result
        table.add_row(
            line.hand if before is None or before.hand != line.hand else "",
            line.sight,
            f"{of.successes}/{of.trials}",
            f"{100 * of.low:.1f} to {100 * of.high:.1f} %",
            *(f"{value:.1f}" for value in (of.mean, of.p95, of.force_median)),
            *(f"{math.degrees(value):.0f}" for value in (of.turn_median, of.turn_p95)),
            Text(of.endings),
        )
    return table
