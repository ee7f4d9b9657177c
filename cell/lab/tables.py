"""Tables of several commands of the laboratory; nothing is printed here."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import Any

from rich.table import Table
from rich.text import Text

from cell.lab.published import PUBLISHED, PUBLISHED_ATTEMPTS, PUBLISHED_SUCCESSES, PUBLISHED_TOTAL, StageLine
from cell.lab.rows import successes
from cell.lab.trials import LOADS, TrialRow, load
from cell.records.statistics import mean, wilson
from sim.world.metering import JERK_BANDWIDTH, OVER_FORCE

LOADED = (
    ("largest contact force (N)", 1),
    ("time above 20 N (s)", 2),
    ("largest jerk in free space (m/s³)", 0),
    ("largest jerk elsewhere (m/s³)", 0),
)
"""Name and decimals of each of `LOADS`."""

PHASES = (
    ("grasp", "grasp_time"),
    ("search", "search_time"),
    ("insertion", "insert_time"),
    ("adjustment and seating", "adjust_time"),
)
"""Parts of the cycle with a column of their own."""


def stages(lines: Sequence[StageLine], cycles: Sequence[float]) -> Table:
    """Return this cell's stage table beside [gibbons], Table I, and below it the mean of the successful runs' cycle times, s."""
    table = Table(title="Stages, beside [gibbons], Table I")
    table.caption = "means of the successes; stages as [gibbons] counts them, cycle from command to answer"
    for name in ("stage", "success", "Wilson 95 %", "time (s)", "published", "time (s)"):
        table.add_column(name, justify="left" if name == "stage" else "right")
    published = [(p.label, p.successes, p.attempts, p.time) for p in PUBLISHED]
    published.append(("total", PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS, PUBLISHED_TOTAL))
    for line, (label, good, attempts, time) in zip(lines, published, strict=True):
        low, high = wilson(line.successes, line.attempts)
        table.add_row(
            label,
            f"{line.successes}/{line.attempts}",
            f"{100 * low:.1f} to {100 * high:.1f} %",
            "-" if line.time is None else f"{line.time:.1f}",
            f"{good}/{attempts}",
            f"{time:.1f}",
        )
    cycle = mean(cycles)
    table.add_row("cycle", "", "", "-" if cycle is None else f"{cycle:.1f}", "", "-")
    return table


def phases(rows: Sequence[TrialRow]) -> Table:
    """Return the mean time of each part of the cycle over the successful runs, and its share of the cycle."""
    table = Table(title="Where the time goes", caption="means of the successes; transfers end where a skill begins")
    for name in ("part of the cycle", "time (s)", "%"):
        table.add_column(name, justify="left" if name == "part of the cycle" else "right")
    good = successes(rows)
    times = {label: mean([getattr(row, name) or 0.0 for row in good]) or 0.0 for label, name in PHASES}
    cycle = mean([row.cycle_time for row in good]) or math.nan
    times["transfers and release"] = cycle - sum(times.values())
    for label, time in (*times.items(), ("cycle", cycle)):
        table.add_row(label, f"{time:.1f}", f"{100 * time / cycle:.0f}")
    return table


def outcomes(rows: Sequence[TrialRow]) -> Table:
    """Return the number of trials with each ending."""
    table = Table("outcome", "stage", "reason", "trials")
    kinds = sorted({(row.outcome, row.stage, row.reason) for row in rows})
    for kind in kinds:
        count = sum((row.outcome, row.stage, row.reason) == kind for row in rows)
        table.add_row(*kind, str(count))
    return table


def loads(rows: Sequence[TrialRow]) -> Table:
    """Return contact force and jerk of the hand over all trials."""
    within = sum(row.peak_contact_force <= OVER_FORCE for row in rows)
    table = Table(title="Force and jerk")
    table.caption = (
        f"{within} of {len(rows)} trials within {OVER_FORCE:g} N; jerk behind a low-pass of {JERK_BANDWIDTH:g} Hz"
    )
    table.add_column("of a trial")
    for name in ("median", "p95", "largest"):
        table.add_column(name, justify="right")
    for name, (label, digits) in zip(LOADS, LOADED, strict=True):
        found = load(rows, name)
        table.add_row(
            label, *(f"{found[key]:.{digits}f}" for key in ("median", "p95", "largest")) if found else ("-",) * 3
        )
    return table


def plain(title: str, lines: Sequence[Any]) -> Table:
    """Return the lines of one dataclass unchanged, SI units."""
    table = Table(title=title)
    names = [field.name for field in fields(lines[0])]
    for name in names:
        table.add_column(name, justify="right")
    for line in lines:
        values = (getattr(line, name) for name in names)
        table.add_row(*(f"{value:.4g}" if isinstance(value, float) else str(value) for value in values))
    return table


Columns = Mapping[str, Callable[[Any], str]]
"""Function that returns the text of a row, by the name of the column."""


def share(successes: int, of: int) -> str:
    """Return a count and its Wilson 95 % interval."""
    low, high = wilson(successes, of)
    return f"{successes}/{of} ({100 * low:.1f} to {100 * high:.1f} %)"


SUCCESSES: Columns = {"success (Wilson 95 %)": lambda line: share(line.successes, line.trials)}
TIMES: Columns = {"mean (s)": lambda line: f"{line.mean:.1f}", "p95 (s)": lambda line: f"{line.p95:.1f}"}
FORCES: Columns = {
    "force (N)": lambda line: f"{line.force_median:.1f}",
    f"within {OVER_FORCE:g} N": lambda line: f"{line.within}/{line.trials}",
}
TURNS: Columns = {
    "turn median (deg)": lambda line: f"{math.degrees(line.turn_median):.0f}",
    "p95 (deg)": lambda line: f"{math.degrees(line.turn_p95):.0f}",
}
ENDINGS: Columns = {"endings other than success": lambda line: line.error or line.endings}
VARIANTS: Columns = {**SUCCESSES, **TIMES, **FORCES, **ENDINGS}
"""Columns of the lines of variants: times are of the successes, forces each trial's largest."""


def table(title: str, names: Columns, columns: Columns, rows: Sequence[Any], caption: str = "") -> Table:
    """Return a table of rows.

    Args:
        title: Title of the table.
        names: Columns on the left that name the row; a text equal to that above it is left out in the first of them.
        columns: Columns of figures.
        rows: Rows, one line each.
        caption: Text below.
    """
    shown, before = Table(title=title, caption=caption or None), ""
    for name in names:
        shown.add_column(name)
    for name in columns:
        shown.add_column(name, justify="left" if name in ENDINGS else "right")
    for row in rows:
        first, *others = (text(row) for text in names.values())
        shown.add_row(
            Text("" if first == before and others else first),
            *map(Text, others),
            *(Text(text(row)) for text in columns.values()),
        )
        before = first
    return shown
