"""Table of the connection."""

from collections.abc import Sequence

from rich.table import Table

from cell.lab.line.measure import Measure


def line(lines: Sequence[Measure]) -> Table:
    """Return the measures of the connection to the PLC."""
    table = Table("measure", "value", "beside", "unit", "target", "holds")
    for each in lines:
        beside = "" if each.beside is None else f"{each.beside:.4g}"
        holds = "" if each.holds is None else "yes" if each.holds else "no"
        table.add_row(each.name, f"{each.value:.4g}", beside, each.unit, each.target, holds)
    return table
