"""`cell study learning`: time saved with each part of a fixture, and the cost of a wrong expected position."""

import argparse
from dataclasses import asdict

from cell.commands.arguments import out_folder, positive
from cell.commands.terminal import progress
from cell.lab.arguments import add_seed, add_study, add_trials, add_workers, load_simulated
from cell.lab.report import StudyReport, finite

SUMMARY = (
    "time by number of the part on a cell that learns where the hole is, beside one that does not and one told wrongly"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell, the number of series, and the number of parts in each."""
    add_study(parser)
    add_seed(parser)
    add_trials(parser, "series in each mode; default 10, with --quick 1")
    parser.add_argument("--parts", type=positive, metavar="N", help="parts of one fixture; default 20, with --quick 3")
    add_workers(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Run every series, write the table, draw the chart."""
    from cell.lab.learning import charts, measure, tables

    config = load_simulated(args, "study learning").cell
    folder = out_folder(args.out)
    parts = args.parts or (3 if args.quick else 20)
    seeds = range(args.seed, args.seed + (args.trials or (1 if args.quick else 10)))
    with progress() as bars:
        bar = bars.add_task("series", total=len(measure.Mode) * len(seeds))
        rows = measure.measure(config, parts, seeds, args.workers, folder, lambda: bars.advance(bar))
    lines = measure.lines_of(rows, parts)
    title = (
        f"{len(seeds)} series of {parts} parts and {parts // measure.EXCHANGED} of another fixture, seeds {seeds[0]} to"
        f" {seeds[-1]}, reality {config.reality.scale:g}"
    )
    result = {"title": title, "lines": [asdict(line) for line in lines], "rows": [asdict(row) for row in rows]}
    files = [folder / measure.TABLE, charts.draw(rows, parts, title, folder)]
    return StudyReport([tables.times(lines, title)], finite(result), files)
