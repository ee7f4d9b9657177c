"""`cell study startup`: the cost of starting the commands that only show something."""

import argparse
import csv
from dataclasses import asdict
from tempfile import TemporaryDirectory

from cell.arguments import out_folder
from cell.lab.arguments import add_out
from cell.lab.report import StudyReport
from cell.terminal import progress

SUMMARY = "what it takes to start the commands that only tell something"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add where the table goes, and the number of starts of each command."""
    add_out(parser)
    parser.add_argument("--quick", action="store_true", help="start each command once instead of 10 times")


def run(args: argparse.Namespace) -> StudyReport:
    """Start every command, and write the table."""
    from cell.lab.startup import measure, tables

    folder = out_folder(args.out)
    with progress() as bars, TemporaryDirectory() as journal:
        bar = bars.add_task("commands", total=len(measure.COMMANDS))
        lines = measure.measure(1 if args.quick else 10, journal, lambda: bars.advance(bar))
    rows = [asdict(line) | {"holds": line.holds} for line in lines]
    file = folder / "startup.csv"
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return StudyReport([tables.table(lines)], rows, [file])
