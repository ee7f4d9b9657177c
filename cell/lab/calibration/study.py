"""`cell study calibration`: accuracy and benefit of an arm calibration."""

import argparse
from dataclasses import asdict

from cell.commands.arguments import out_folder
from cell.commands.terminal import progress
from cell.lab.arguments import add_seed, add_study, add_trials, add_workers, load_simulated
from cell.lab.report import StudyReport, finite

SUMMARY = "whether what `cell calibrate arm` finds is true, and the first peg of an arm with and without it"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell and the number of arms of each kind."""
    add_study(parser)
    add_seed(parser)
    add_trials(parser, "arms of each kind; default 8, with --quick 1")
    parser.add_argument("--arms", action="append", default=[], metavar="NAME", help="a kind of arms; all if not given")
    add_workers(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Calibrate arms of every kind, compare them, test each with and without calibration, and write the tables."""
    from cell.lab.calibration import measure, tables
    from cell.lab.frontier.measure import title_of
    from cell.lab.rows import write_rows

    config = load_simulated(args, "study calibration").cell
    folder = out_folder(args.out)
    seeds = range(args.seed, args.seed + (args.trials or (1 if args.quick else 8)))
    names = args.arms or (list(measure.SCALES)[:1] if args.quick else [])
    configs = measure.kinds(args.config, args.set, config, folder, names)
    with progress() as bars:
        bar = bars.add_task("arms", total=len(configs) * len(seeds))
        lines = measure.measure(configs, seeds, args.workers, folder, lambda count: bars.advance(bar, count))
    title = title_of(seeds)
    file = write_rows([result for line in lines for result in line.results], folder / "calibration.csv")
    result = {"title": title, "lines": [asdict(line) for line in lines]}
    return StudyReport([tables.truth(lines, title), tables.pegs(lines)], finite(result), [file])
