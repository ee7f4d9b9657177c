"""Table of the study of seating without a switch."""

from collections.abc import Sequence

from rich.table import Table

from cell.lab.seating.drawn import NOISES, DrawnLine
from cell.lab.seating.measure import SeatingLine


def seating(lines: Sequence[SeatingLine], title: str) -> Table:
    """Return missed and false seatings, case by case."""
    caption = "false: called seated, or let pass by the gate had the skill said so, and not seated; interval of the case's own error; "
    caption += "ways: mean number of ways down; hanging: median way over which deviations from the latch hang together"
    table = Table(title=title, caption=caption)
    for name in ("latch", "case", "trials", "seated", "missed", "false", "Wilson 95 %", "ways", "hanging (mm)"):
        table.add_column(name, justify="left" if name in ("latch", "case") else "right")
    for line in lines:
        counts = (line.trials, line.seated, line.missed, line.false)
        interval = f"{100 * line.low:.1f} to {100 * line.high:.1f} %"
        table.add_row(
            line.kind,
            line.case,
            *(str(count) for count in counts),
            interval,
            *(f"{line.ways:.1f}", f"{1e3 * line.hanging:.2f}"),
        )
    return table


def of_drawn(lines: Sequence[DrawnLine]) -> Table:
    """Return the number of drawn curves of every end that are judged as a seated part."""
    curves = lines[0].curves
    table = Table(title=f"{curves} drawn curves of a detent for each figure: told to be of a seated part")
    table.add_column("end")
    for noise, wander in NOISES:
        table.add_column(f"noise {noise:g} N, wander {wander:g} N", justify="right")
    for line in lines:
        table.add_row(line.end, *(str(count) for count in line.told))
    return table
