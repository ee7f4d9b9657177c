"""`cell study stability`: gain against the skin's period and delay, beside sampled-loop theory."""

import argparse

from cell.commands.arguments import out_folder
from cell.commands.terminal import progress
from cell.lab.arguments import add_study, add_workers, load_simulated
from cell.lab.report import StudyReport

SUMMARY = "where the loop through the skin goes unstable, beside theory, and the margins of the gains in use"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell, and the number of processes."""
    add_study(parser)
    add_workers(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Measure the map, write every case and the figures, draw the charts."""
    from cell.lab.stability import charts, report, tables

    config, folder = load_simulated(args, "study stability").cell, out_folder(args.out)
    with progress() as bars:
        bar = bars.add_task("cases", total=report.cases(args.quick))
        found = report.run(config, args.quick, args.workers, lambda n: bars.advance(bar, n))
    files = [*report.write(found, folder), *charts.draw(found, folder)]
    return StudyReport([tables.table(found)], found.data, files)
