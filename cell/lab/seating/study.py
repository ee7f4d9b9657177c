"""`cell study seating`: rate of missed and of false seatings from force against depth, in a hole without a switch."""

import argparse
from dataclasses import asdict

from cell.commands.arguments import out_folder
from cell.commands.terminal import progress
from cell.lab.arguments import add_seed, add_study, add_trials, add_workers, load_simulated
from cell.lab.report import StudyReport, finite

SUMMARY = (
    "holes without a switch: seated parts that are missed, and others that are taken for seated, by force against depth"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell, the kind of latch, and the number of trials of each case."""
    add_study(parser)
    add_seed(parser)
    add_trials(parser, "trials of each case; default 20, with --quick 1")
    parser.add_argument("--latch", action="append", default=[], choices=("detent", "press"), help="both if not given")
    parser.add_argument(
        "--case", action="append", default=[], metavar="NAME", help="a case by its name; all if not given"
    )
    add_workers(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Run every case of every kind of latch, write the table, draw the picture."""
    from cell.lab.seating import charts, drawn, measure, tables

    config = load_simulated(args, "study seating").cell
    folder = out_folder(args.out)
    kinds = args.latch or (["detent"] if args.quick else list(measure.LATCHES))
    trials = args.trials or (1 if args.quick else 20)
    counts = dict.fromkeys(measure.case_names(args.case), trials)
    with progress() as bars, measure.growing_table(folder / measure.TABLE) as add:
        bar = bars.add_task("trials", total=len(kinds) * sum(counts.values()))

        def done(row: measure.SeatingRow) -> None:
            add(row)
            bars.advance(bar)

        rows, curves = measure.measure(config, kinds, counts, args.seed, args.workers, done)
    told = drawn.drawn(measure.LATCHES["detent"], 100 if args.quick else 1000, args.seed)
    title = (
        f"{trials} trials of each case, seeds {args.seed} to {args.seed + trials - 1}, reality {config.reality.scale:g}"
    )
    measure.write_table(rows, folder / measure.TABLE)
    lines = measure.lines_of(rows)
    result = {
        "title": title,
        "lines": [asdict(line) for line in lines],
        "drawn": [asdict(line) for line in told],
        "rows": [asdict(row) for row in rows],
    }
    files = [folder / measure.TABLE, charts.draw(curves, title, folder)]
    return StudyReport([tables.seating(lines, title), tables.of_drawn(told)], finite(result), files)
