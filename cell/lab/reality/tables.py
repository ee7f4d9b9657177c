"""Tables of the study of errors."""

from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from cell.lab.frontier.measure import FrontierLine
from cell.lab.reality.measure import Rank, Tolerance
from cell.lab.results import TrialsResult


def sizes(lines: Sequence[FrontierLine], title: str) -> Table:
    """Return success and speed of the cell under each error and scale."""
    table = Table(title=title, caption="times are of the successes, s; forces are each trial's largest, N")
    for name in ("error", "scale", "success", "Wilson 95 %", "mean", "p95", "force median", "force p95", "retries"):
        table.add_column(name, justify="left" if name == "error" else "right")
    table.add_column("endings other than success")
    for before, line in zip((None, *lines), lines, strict=False):
        table.add_row(
            line.family if before is None or before.family != line.family else "",
            line.variant,
            f"{line.successes}/{line.trials}",
            f"{100 * line.low:.1f} to {100 * line.high:.1f} %",
            *(f"{value:.1f}" for value in (line.mean, line.p95, line.force_median, line.force_p95)),
            str(line.retries),
            Text(line.error or line.endings),
        )
    return table


def tolerances(sheet: Sequence[Tolerance]) -> Table:
    """Return the tolerances for the installation of a cell."""
    table = Table(title="Each error alone may be so large")
    for name in ("error", "what it is", "borne", "too much", "unit", "scale", "successes"):
        table.add_column(name)
    for line in sheet:
        table.add_row(line.error, line.about, line.size, line.beyond, line.unit, f"{line.scale:g}", line.lost)
    return table


def ranking(ranks: Sequence[Rank]) -> Table:
    """Return the errors on which time and force depend if all are drawn."""
    table = Table(title="Share of the variance explained by the size of each error, all together at scale 1")
    for name in ("error", "of the time", "of the force"):
        table.add_column(name, justify="left" if name == "error" else "right")
    for rank in ranks:
        table.add_row(rank.error, f"{rank.time:.2f}", f"{rank.force:.2f}")
    return table


def rows(found: Sequence[TrialsResult], title: str) -> Table:
    """Return success, time and force under each named error."""
    table = Table(title=title, caption="times are of the successes, s; forces are each trial's largest, N")
    for name in ("error", "success", "Wilson 95 %", "mean", "p95", "force median", "within 20 N"):
        table.add_column(name, justify="left" if name == "error" else "right")
    table.add_column("endings other than success")
    for row in found:
        table.add_row(
            row.name,
            f"{row.successes}/{row.trials}",
            f"{100 * row.low:.1f} to {100 * row.high:.1f} %",
            *(f"{value:.1f}" for value in (row.mean, row.p95, row.force_median)),
            f"{row.within}/{row.trials}",
            Text(row.endings),
        )
    return table
