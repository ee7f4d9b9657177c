"""`cell study touch`: the value of touch, from hands without it."""

import argparse
from dataclasses import asdict

from cell.commands.arguments import out_folder
from cell.commands.terminal import progress
from cell.lab.arguments import add_seed, add_study, add_trials, add_workers, load_simulated
from cell.lab.report import StudyReport, finite

SUMMARY = (
    "what touch is worth: each preset and a regime of turning pegs, beside the same with theta frozen or taken for 0"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell, and the number of trials of each case."""
    add_study(parser)
    add_seed(parser)
    add_trials(parser, "trials of each case; default 20, with --quick 1")
    parser.add_argument(
        "--hand",
        action="append",
        default=[],
        metavar="NAME",
        help='a preset or "turning pegs"; all of them if not given',
    )
    add_workers(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Run every hand with every sight on the same seeds, write the table, draw the chart."""
    from cell.lab.frontier.measure import title_of
    from cell.lab.rows import write_rows
    from cell.lab.touch import charts, measure, tables

    load_simulated(args, "study touch")
    folder = out_folder(args.out)
    seeds = range(args.seed, args.seed + (args.trials or (1 if args.quick else 20)))
    tried = measure.hands(args.config, args.hand or (measure.QUICK if args.quick else ()))
    with progress() as bars:
        bar = bars.add_task("trials", total=len(tried) * len(measure.SIGHTS) * len(seeds))
        lines = measure.measure(
            args.config, args.set, tried, seeds, args.workers, folder, lambda count: bars.advance(bar, count)
        )
    title = title_of(seeds)
    files = [
        write_rows([line.result for line in lines], folder / measure.TABLE),
        charts.draw(lines, title, folder),
    ]
    result = {"title": title, "lines": [asdict(line) for line in lines]}
    return StudyReport([tables.touch(lines, title)], finite(result), files)
