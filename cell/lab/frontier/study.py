"""`cell study frontier`: speed against accuracy, of presets, of settings, and of each step from the paper's method."""

import argparse
from dataclasses import asdict

from cell.arguments import out_folder
from cell.lab.arguments import add_seed, add_study, add_trials, add_workers, load_simulated
from cell.lab.report import StudyReport, finite
from cell.terminal import progress

SUMMARY = "speed against accuracy: presets, settings, and each step from the paper's method"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what is simulated, and the number of trials of each variant."""
    add_study(parser)
    add_seed(parser)
    add_trials(parser, "of each variant; 40, with --quick 2")
    add_workers(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Run every variant on the same seeds, write the table, draw both charts."""
    from cell.lab.frontier import charts, measure, tables

    load_simulated(args, "study frontier")
    folder = out_folder(args.out)
    seeds = range(args.seed, args.seed + (args.trials or (2 if args.quick else 40)))
    tried = measure.variants(args.config, args.set, args.quick)
    with progress() as bars:
        bar = bars.add_task("trials", total=len(tried) * len(seeds))
        lines = measure.measure(
            args.config, args.set, tried, seeds, args.workers, folder, lambda count: bars.advance(bar, count)
        )
    title = measure.title_of(seeds)
    files = [folder / measure.FRONTIER, *charts.draw(lines, title, folder)]
    result = {"title": title, "lines": [asdict(line) for line in lines]}
    return StudyReport([tables.frontier(lines, title)], finite(result), files)
