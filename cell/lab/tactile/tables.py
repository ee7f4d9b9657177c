"""Tables of the estimators."""

from collections.abc import Sequence

from rich.console import Group
from rich.table import Table

from cell.lab.tactile.measure import TactileLine, TactileStudy


def tactile(found: TactileStudy) -> Group:
    """Return accuracy and speed of each estimator."""
    table = Table("layout", "pads", "frames", "estimator", "told", "RMSE (deg)", "p95", "worst", "in 1.96 sigma", "us")
    for line in found.lines:
        table.add_row(
            line.layout,
            line.model,
            f"{line.condition}, n = {line.frames}",
            line.estimator,
            f"{100 * line.told:.1f} %",
            *(f"{value:.2f}" for value in (line.rmse, line.p95, line.worst, line.covered)),
            f"{1e6 * line.time:.0f}",
        )
    missed = Table("layout", "what the bed of springs leaves out, beside an elastic layer", "size")
    for item in found.fidelity:
        missed.add_row(item.layout, item.what, f"{100 * item.size:.1f} %")
    return Group(table, missed)


def bounds(lines: Sequence[TactileLine]) -> Table:
    """Return the bounds of the estimation with known pads."""
    table = Table("layout", "frames", "the pads known, and the", "RMSE (deg)", "p95", "worst", "in 1.96 sigma")
    for line in lines:
        figures = (f"{value:.2f}" for value in (line.rmse, line.p95, line.worst, line.covered))
        table.add_row(line.layout, f"{line.condition}, n = {line.frames}", line.estimator, *figures)
    return table
