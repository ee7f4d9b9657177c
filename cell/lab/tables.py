"""Tables of the laboratory; nothing is printed here."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any

from rich.table import Table
from rich.text import Text

from cell.lab.published import PUBLISHED, PUBLISHED_TOTAL, StageLine
from cell.lab.rows import successes
from cell.lab.trials import LOADS, TrialRow, load
from cell.records.statistics import mean, wilson
from sim.world.metering import JERK_BANDWIDTH, OVER_FORCE

PHASES = {
    "grasp": "grasp_time",
    "search": "search_time",
    "insertion": "insert_time",
    "adjustment and seating": "adjust_time",
}
"""Parts of the cycle that have a column of their own: name, and column."""
ENDINGS = "endings other than success"
Columns = Mapping[str, Callable[[Any], str]]
"""Function that returns the text of a row, by the name of the column."""


def share(successes: int, of: int) -> str:
    """Return a count and its Wilson 95 % interval."""
    low, high = wilson(successes, of)
    return f"{successes}/{of} ({100 * low:.1f} to {100 * high:.1f} %)"


SUCCESSES: Columns = {"success (Wilson 95 %)": lambda line: share(line.successes, line.trials)}
VARIANTS: Columns = {
    **SUCCESSES,
    "mean (s)": lambda line: f"{line.mean:.1f}",
    "p95 (s)": lambda line: f"{line.p95:.1f}",
    "force (N)": lambda line: f"{line.force_median:.1f}",
    f"within {OVER_FORCE:g} N": lambda line: f"{line.within}/{line.trials}",
    ENDINGS: lambda line: line.error or line.endings,
}
"""Columns of the lines of variants: times are over the successes; the force is the largest of each trial."""
TURNS: Columns = {
    "turn median (deg)": lambda line: f"{math.degrees(line.turn_median):.0f}",
    "p95 (deg)": lambda line: f"{math.degrees(line.turn_p95):.0f}",
}


def listed(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "", names: int = 1) -> Table:
    """Return texts as a table.

    Args:
        title: Title of the table.
        heads: Heads of the columns.
        rows: Texts of each row.
        caption: Text below the table.
        names: Number of columns on the left that name the row; if there are several, a text in the first column is left out
            if it equals the text above it.
    """
    shown, before = Table(title=title, caption=caption), ""
    for number, head in enumerate(heads):
        shown.add_column(head, justify="left" if number < names or head == ENDINGS else "right")
    for first, *others in rows:
        shown.add_row(Text("" if first == before and names > 1 else first), *map(Text, others))
        before = first
    return shown


def table(title: str, names: Columns, columns: Columns, rows: Sequence[Any], caption: str = "") -> Table:
    """Return a table of rows.

    Args:
        title: Title of the table.
        names: Columns on the left that name the row.
        columns: Columns of figures.
        rows: Rows, one line each.
        caption: Text below.
    """
    texts = (*names.values(), *columns.values())
    return listed(title, [*names, *columns], ([text(row) for text in texts] for row in rows), caption, len(names))


def plain(title: str, lines: Sequence[Any]) -> Table:
    """Return the lines of one dataclass unchanged, SI units."""
    names = [field.name for field in fields(lines[0])]
    values = ([getattr(line, name) for name in names] for line in lines)
    rows = ([f"{value:.4g}" if isinstance(value, float) else str(value) for value in row] for row in values)
    return listed(title, names, rows)


def stages(lines: Sequence[StageLine], cycles: Sequence[float]) -> Table:
    """Return this cell's stage table next to [gibbons], Table I; below it is the mean cycle time of the successful runs, s."""
    rows = []
    for line, theirs in zip(lines, (*PUBLISHED, PUBLISHED_TOTAL), strict=True):
        low, high = wilson(line.successes, line.attempts)
        own = f"{line.successes}/{line.attempts}", f"{100 * low:.1f} to {100 * high:.1f} %", _seconds(line.time)
        rows.append((theirs.label, *own, f"{theirs.successes}/{theirs.attempts}", f"{theirs.time:.1f}"))
    rows.append(("cycle", "", "", _seconds(mean(cycles)), "", "-"))
    caption = "means of the successes; stages as [gibbons] counts them, cycle from command to answer"
    heads = "stage", "success", "Wilson 95 %", "time (s)", "published", "their time (s)"
    return listed("Stages, beside [gibbons], Table I", heads, rows, caption)


def phases(rows: Sequence[TrialRow]) -> Table:
    """Return the mean time of each part of the cycle over the successful runs, and its share of the cycle."""
    good = successes(rows)
    times = {label: mean([getattr(row, name) or 0.0 for row in good]) or 0.0 for label, name in PHASES.items()}
    cycle = mean([row.cycle_time for row in good]) or math.nan
    times |= {"transfers and release": cycle - sum(times.values()), "cycle": cycle}
    found = [(label, f"{time:.1f}", f"{100 * time / cycle:.0f}") for label, time in times.items()]
    caption = "means of the successes; transfers end where a skill begins"
    return listed("Where the time goes", ("part of the cycle", "time (s)", "%"), found, caption)


def outcomes(rows: Sequence[TrialRow]) -> Table:
    """Return the number of trials with each ending."""
    kinds = [(row.outcome, row.stage, row.reason) for row in rows]
    found = [(*kind, str(kinds.count(kind))) for kind in sorted(set(kinds))]
    return listed("", ("outcome", "stage", "reason", "trials"), found)


def loads(rows: Sequence[TrialRow]) -> Table:
    """Return contact force and jerk of the hand over all trials."""
    within, keys = sum(row.peak_contact_force <= OVER_FORCE for row in rows), ("median", "p95", "largest")
    found = []
    for name, (label, digits) in LOADS.items():
        values = load(rows, name)
        found.append((label, *(f"{values[key]:.{digits}f}" if values else "-" for key in keys)))
    caption = f"{within} of {len(rows)} trials within {OVER_FORCE:g} N; jerk behind a low-pass of {JERK_BANDWIDTH:g} Hz"
    return listed("Force and jerk", ("of a trial", *keys), found, caption)


def _seconds(time: float | None) -> str:
    return "-" if time is None else f"{time:.1f}"
