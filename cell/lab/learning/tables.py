"""The table of the study of learning."""

from collections.abc import Sequence

from rich.table import Table

from cell.lab.learning.measure import PartLine


def times(lines: Sequence[PartLine], title: str) -> Table:
    """Return mean times by knowledge of the hole's position and by range of parts."""
    table = Table(title=title, caption="times are means of the successes, s, with half the 95 % interval of the mean")
    for name in ("the cell", "parts", "success", "with a place", "search", "total"):
        table.add_column(name, justify="left" if name in ("the cell", "parts") else "right")
    for line in lines:
        table.add_row(
            line.mode,
            line.parts,
            f"{line.successes}/{line.trials}",
            f"{line.expected}/{line.trials}",
            f"{line.search:.2f}",
            f"{line.total:.2f} +- {line.total_error:.2f}",
        )
    return table
