"""`cell study tactile`: how well and how fast each estimator reads the peg's angle from the taxels."""

import argparse

from cell.arguments import out_folder
from cell.lab.arguments import add_study, load_simulated
from cell.lab.report import StudyReport
from cell.terminal import progress

SUMMARY = "reading the peg's angle from the taxels: every estimator's error, time and honesty"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the config of the simulated skin."""
    add_study(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Read frames of every kind, write the table, draw the charts."""
    from cell.lab.tactile import charts, measure, tables

    config, folder = load_simulated(args, "study tactile", pace=None).cell, out_folder(args.out)
    with progress() as bars:
        bar = bars.add_task("frames", total=measure.parts())
        found = measure.study(config, args.quick, lambda: bars.advance(bar))
    files = [folder / "tactile.csv"]
    measure.write_lines(found.lines, files[0])
    files += charts.draw(found.lines, found.nominal, folder)
    return StudyReport([tables.tactile(found)], found.as_data() | {"files": [str(path) for path in files]}, files)
