"""`cell report`: summary of many recorded runs, printed and drawn."""

import argparse
import gc
import re
from dataclasses import asdict, replace

from rich.box import SIMPLE_HEAD
from rich.console import Group

from cell.commands.arguments import add_query, add_records, file_path, query_of, read_journal, require_program
from cell.commands.terminal import GOOD, filled, show, written
from cell.report.facts import Facts, facts_of
from cell.report.queries import SHIFTS
from cell.report.words import require_kind, tables
from cell.run.line import PROGRAMS
from plc_bridge.protocol.messages import FIRST_PROGRAM


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the selection of runs, and the file."""
    add_records(parser)
    add_query(parser)
    parser.add_argument(
        "--shifts", type=shifts, metavar="TIMES", help="starts of the shifts, local time; default 06:00,14:00,22:00"
    )
    parser.add_argument("--out", type=file_path, metavar="FILE", help="*.html or *.pdf, with everything in it")


def shifts(text: str) -> tuple[str, ...]:
    """Return the starts of the shifts, `HH:MM`, in their order."""
    starts = text.split(",")
    if not all(re.fullmatch(r"([01]\d|2[0-3]):[0-5]\d", start) for start in starts) or len({*starts}) < len(starts):
        raise argparse.ArgumentTypeError(f"{text!r}: times of a day, each once, allowed, as in 06:00,14:00,22:00")
    return tuple(sorted(starts))


def run(args: argparse.Namespace) -> int:
    """Print the report, or write it to a file if requested."""
    gc.disable()  # the rows of 100,000 runs hold no cycles, and the search for cycles takes a tenth of a second
    try:
        return _report(args)
    finally:
        gc.enable()


def _report(args: argparse.Namespace) -> int:
    if args.out is not None:
        require_kind(args.out)
    query = query_of(args)
    if query.program is None:
        query = replace(query, program=PROGRAMS[FIRST_PROGRAM])
    with read_journal(args) as journal:
        facts = facts_of(journal, query, args.shifts or SHIFTS)
    if not facts.total.runs:
        require_program(query)
    shown = []
    for title, head, rows in tables(facts):
        dense = {"box": SIMPLE_HEAD, "pad_edge": False, "padding": (0, 1, 0, 0)}
        table = filled(head, rows, title=title, title_justify="left", **dense)
        # The start of a shift stays on one line.
        table.columns[0].min_width = len("12-31 22:00")
        shown.append(table)
    show(args, Group(*shown), _data(facts) if args.json else None)
    if args.out is not None:
        from cell.report.document import write  # imported late: the tables must not wait for the charts

        write(facts, args.out)
    written(args, [args.out] if args.out is not None else [])
    return GOOD


def _data(facts: Facts) -> dict[str, object]:
    """Return a report for programs; its long lists are not copied."""
    short = asdict(replace(facts, forces=(), residuals=()))
    long = {"forces": facts.forces, "residuals": facts.residuals}
    return {**short, **long, "yield": facts.total.share, "interval": facts.total.interval}
