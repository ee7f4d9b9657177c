"""The table of the starts."""

from collections.abc import Sequence

from rich.table import Table

from cell.lab.startup.measure import LIMIT, StartLine


def table(lines: Sequence[StartLine]) -> Table:
    """Return the cost of starting each command."""
    shown = Table(title=f"Start of commands, time of the processor; at most {LIMIT:g} s wanted")
    for name in ("command", "median (s)", "worst (s)", "n", "holds", "heavy packages imported"):
        shown.add_column(name, justify="right" if "(s)" in name or name == "n" else "left")
    for line in lines:
        holds = "yes" if line.holds else "no"
        shown.add_row(
            line.command, f"{line.time:.2f}", f"{line.worst:.2f}", str(line.starts), holds, line.heavy or "none"
        )
    return shown
