"""`cell study events`: false hole events on plates without a hole, and true ones at a drop of the peg."""

import argparse
from dataclasses import asdict

from cell.commands.arguments import out_folder
from cell.commands.terminal import progress
from cell.lab.arguments import add_seed, add_study, add_trials, add_workers, load_simulated
from cell.lab.report import StudyReport, finite

SUMMARY = "hole events, false and true: how often a search stops without a hole, how soon where there is one"
QUICK_TIMEOUT = 8.0
"""Timeout of a search with --quick, s."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell and the number of searches."""
    add_study(parser)
    add_seed(parser)
    add_trials(parser, "searches without a hole; default 1000, with --quick 4")
    add_workers(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Search with and without a hole, write the table, draw the chart."""
    from cell.lab.events import charts, report, tables
    from cell.lab.rows import write_rows
    from skills.catalogue import SEARCH

    config, folder = load_simulated(args, "study events").cell, out_folder(args.out)
    trials = args.trials or (4 if args.quick else 1000)
    if args.quick:
        config = config.with_params(SEARCH, timeout=min(config.params(SEARCH).timeout, QUICK_TIMEOUT))
    seeds, with_hole = range(args.seed, args.seed + trials), min(trials, 200)
    with progress() as bars:
        bar = bars.add_task("searches", total=len(seeds) + with_hole)
        found = report.run(config, seeds, with_hole, args.workers, lambda: bars.advance(bar))
    files = [folder / report.TABLE, folder / charts.CHART]
    write_rows(found.lines, files[0])
    charts.draw(found, config.params(SEARCH), files[1])
    result = {"title": found.title, "lines": [asdict(line) for line in found.lines], "others": found.others}
    return StudyReport([tables.table(found)], finite(result), files)
