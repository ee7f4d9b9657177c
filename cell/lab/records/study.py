"""`cell study records`: cost of queries to a journal with weeks of runs."""

import argparse
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory

from cell.commands.arguments import out_folder, positive
from cell.commands.terminal import progress
from cell.lab.arguments import add_out
from cell.lab.report import StudyReport

SUMMARY = "how soon questions about runs are answered where the journal holds the runs of weeks"
RUNS, QUICK_RUNS = 100_000, 2_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the output folder, and the number of recorded runs."""
    add_out(parser)
    parser.add_argument("--runs", type=positive, default=RUNS, metavar="N", help=f"runs on record; {RUNS}")
    parser.add_argument(
        "--quick", action="store_true", help=f"{QUICK_RUNS} runs, each question once instead of 5 times"
    )


def run(args: argparse.Namespace) -> StudyReport:
    """Fill a journal, run the queries, and write the table."""
    from cell.lab.records import measure, tables
    from cell.lab.rows import write_rows

    folder, runs = out_folder(args.out), QUICK_RUNS if args.quick else args.runs
    with progress() as bars, TemporaryDirectory() as journal:
        filled = bars.add_task("runs", total=runs - len(measure.MADE))
        measure.fill(Path(journal), runs, lambda count: bars.advance(filled, count))
        asked = measure.questions(runs, Path(journal) / "report")
        bar = bars.add_task("questions", total=len(asked) + measure.OF_THE_PAGE)
        lines = measure.measure(Path(journal), runs, 1 if args.quick else 5, lambda: bars.advance(bar), asked)
    rows = [asdict(line) | {"holds": line.holds} for line in lines]
    file = folder / "records.csv"
    write_rows(rows, file)
    return StudyReport([tables.table(lines)], rows, [file])
