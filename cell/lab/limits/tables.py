"""Table of limits."""

from collections.abc import Sequence

from rich.table import Table

from cell.lab.limits.lines import LimitsLine


def limits(lines: Sequence[LimitsLine], title: str) -> Table:
    """Return each phase's bound beside the result, case by case."""
    table = Table(
        title=title, caption="reached: a cover as the sum of times over that of shares tells it, else medians"
    )
    table.add_column("phase")
    for name in ("bound", "reached", "n"):
        table.add_column(name, justify="right")
    table.add_column("5 to 95 %, or interval")
    table.add_column("bound with")
    before = ""
    for line in lines:
        if line.case != before:
            table.add_section()
            table.add_row(f"[bold]{line.case}[/bold]")
        before = line.case
        table.add_row(
            line.phase,
            f"{line.bound:.3g} {line.unit}",
            f"{line.reached:.3g} {line.unit}",
            str(line.count),
            f"{line.spread[0]:.3g} to {line.spread[1]:.3g}",
            line.told,
        )
    return table
