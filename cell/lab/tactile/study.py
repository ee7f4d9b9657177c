"""`cell study tactile`: accuracy and speed of each estimator of the peg's angle from the taxels."""

import argparse
from dataclasses import asdict

from cell.commands.arguments import out_folder
from cell.commands.terminal import progress
from cell.lab.arguments import add_study, load_simulated
from cell.lab.report import StudyReport

SUMMARY = "reading the peg's angle from the taxels: every estimator's error, time and honesty"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the config of the simulated skin."""
    add_study(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Estimate frames of every kind, write the table, draw the charts."""
    from cell.lab.rows import write_rows
    from cell.lab.tactile import bound, charts, measure, tables

    config, folder = load_simulated(args, "study tactile", pace=None).cell, out_folder(args.out)
    with progress() as bars:
        bar = bars.add_task("frames", total=measure.parts() + bound.parts())
        found = measure.study(config, args.quick, lambda: bars.advance(bar))
        bounds = bound.bounds(config, args.quick, lambda: bars.advance(bar))
    files = [folder / "tactile.csv"]
    write_rows(found.lines, files[0])
    files += charts.draw(found.lines, found.nominal, folder)
    data = found.as_data() | {"bounds": [asdict(line) for line in bounds], "files": [str(path) for path in files]}
    return StudyReport([tables.tactile(found), tables.bounds(bounds)], data, files)
