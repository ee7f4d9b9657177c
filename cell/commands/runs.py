"""`cell runs`: the newest runs on record."""

import argparse
from collections.abc import Iterable
from dataclasses import asdict
from typing import TYPE_CHECKING

from cell.arguments import add_journal, open_journal, positive
from cell.terminal import GOOD, show

if TYPE_CHECKING:
    from rich.table import Table

    from cell.journal import RunRow

SUMMARY = "the newest runs on record"
STOPS_ITSELF = False


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add where the records are, and how many runs are shown."""
    add_journal(parser)
    parser.add_argument("--last", type=positive, default=20, metavar="N")


def run(args: argparse.Namespace) -> int:
    """Show one line a run, newest first."""
    with open_journal(args) as journal:
        rows = journal.runs(args.last)
    show(args, _table(rows), [asdict(row) for row in rows])
    return GOOD


def _table(rows: "Iterable[RunRow]") -> "Table":
    from rich.table import Table

    table = Table("run", "started (UTC)", "program", "recipe", "serial", "source", "seq", "outcome", "stage", "reason")
    for row in rows:
        table.add_row(
            str(row.run),
            row.started[:19],
            row.program,
            str(row.recipe),
            row.serial,
            row.source,
            str(row.sequence),
            row.outcome,
            row.stage,
            row.reason or row.message,
        )
    return table
