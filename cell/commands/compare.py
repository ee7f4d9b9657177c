"""`cell compare`: two recorded runs side by side, with the differences of their configs and versions."""

import argparse
from typing import TYPE_CHECKING

from cell.commands.arguments import add_journal, positive, read_journal
from cell.commands.terminal import GOOD, show

if TYPE_CHECKING:
    from rich.console import RenderableType

SUMMARY = "two runs side by side, and where their configs differ"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the two runs."""
    add_journal(parser)
    parser.add_argument("first", type=positive, metavar="RUN")
    parser.add_argument("second", type=positive, metavar="RUN")


def run(args: argparse.Namespace) -> int:
    """Show two runs side by side."""
    from cell.report.comparison import compared

    numbers = (args.first, args.second)
    with read_journal(args) as journal:
        rows = [journal.find(number) for number in numbers]
        stages = [journal.stages(number) for number in numbers]
        configs = [journal.config(row.config_hash) for row in rows]
    found = compared(rows, stages, configs)
    data = {
        title: [dict(zip(("what", "first", "second"), row, strict=True)) for row in lines] for title, lines in found
    }
    show(args, _picture(found, numbers), {"runs": numbers, **data})
    return GOOD


def _picture(found: "list[tuple[str, list[tuple[str, str, str]]]]", numbers: tuple[int, int]) -> "RenderableType":
    from rich.console import Group
    from rich.table import Table

    shown = []
    for title, lines in found:
        table = Table(title, *(f"run {number}" for number in numbers))
        for what, first, second in lines:
            table.add_row(what, first, second, style="bold" if first != second else "")
        shown.append(table)
    return Group(*shown)
