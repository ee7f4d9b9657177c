"""Table of the queries."""

from collections.abc import Sequence

from rich.table import Table

from cell.lab.records.measure import LIMIT, QuestionLine


def table(lines: Sequence[QuestionLine]) -> Table:
    """Return the duration of every query."""
    shown = Table(title=f"Questions to {lines[0].runs:,} runs on record; at most {LIMIT:g} s of processor time wanted")
    for name in ("question", "first words, worst (s)", "CPU (s)", "with drawing (s)", "n", "holds"):
        shown.add_column(name, justify="right" if "(s)" in name or name == "n" else "left")
    for line in lines:
        shown.add_row(
            line.question,
            f"{line.time:.2f}, {line.worst:.2f}",
            f"{line.answer:.2f}",
            f"{line.whole:.2f}",
            str(line.asked),
            "yes" if line.holds else "no",
        )
    return shown
