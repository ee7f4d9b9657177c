"""`cell compare`: two recorded runs, or the runs of two periods, side by side, with their differences."""

import argparse
from dataclasses import replace

from rich.console import Group, RenderableType
from rich.table import Table

from cell.commands.arguments import add_query, add_records, period_of, positive, query_of, read_journal
from cell.commands.terminal import show
from cell.report.comparison import compared, compared_periods
from cell.report.facts import facts_of
from drivers.errors import ConfigError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the two runs, or the two periods."""
    add_records(parser)
    add_query(parser)
    parser.add_argument("first", nargs="?", type=positive, metavar="RUN")
    parser.add_argument("second", nargs="?", type=positive, metavar="RUN")
    parser.add_argument("--with", dest="earlier", metavar="WHEN", help="start of the period that ends at --since")


def run(args: argparse.Namespace) -> int:
    """Show two runs or two periods side by side."""
    if args.second is not None and not (args.since or args.earlier):
        heads, found = _runs(args)
    elif args.first is None and args.since and args.earlier:
        heads, found = _periods(args)
    else:
        raise ConfigError("compare: two runs (RUN RUN) or two periods (--since 7d --with 14d) needed")
    names = ("what", "first", "second")
    data = {title: [dict(zip(names, row, strict=True)) for row in lines] for title, lines in found}
    return show(args, _picture(found, heads), {"compared": heads, **data})


def _runs(args: argparse.Namespace) -> tuple[tuple[str, str], list[tuple[str, list[tuple[str, str, str]]]]]:
    numbers = (args.first, args.second)
    with read_journal(args) as journal:
        rows = [journal.find(number) for number in numbers]
        stages = [journal.stages(number) for number in numbers]
        configs = [journal.config(row.config_hash) for row in rows]
    return (f"run {numbers[0]}", f"run {numbers[1]}"), compared(rows, stages, configs)


def _periods(args: argparse.Namespace) -> tuple[tuple[str, str], list[tuple[str, list[tuple[str, str, str]]]]]:
    later = query_of(args)
    since, until = period_of(argparse.Namespace(since=args.earlier, until=args.since), ("--with", "--since"))
    with read_journal(args) as journal:
        facts = [facts_of(journal, each) for each in (replace(later, since=since, until=until), later)]
    ends = f" until {args.until}" if args.until else ""
    return (f"{args.earlier} until {args.since}", f"since {args.since}{ends}"), compared_periods(*facts)


def _picture(found: list[tuple[str, list[tuple[str, str, str]]]], heads: tuple[str, str]) -> RenderableType:
    shown = []
    for title, lines in found:
        table = Table(title, *heads)
        for what, first, second in lines:
            table.add_row(what, first, second, style="bold" if first != second else "")
        shown.append(table)
    return Group(*shown)
