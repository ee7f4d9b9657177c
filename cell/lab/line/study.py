"""`cell study line`: the cell's server beside a bare one, and what the scan feels of fifty clients."""

import argparse
from dataclasses import asdict

from cell.arguments import out_folder
from cell.lab.arguments import add_study, load_simulated
from cell.lab.report import StudyReport

SUMMARY = "the line to the PLC: answers, commands, and the scan beside fifty clients"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add which cell is served."""
    add_study(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Measure in real time, write the figures, draw the distributions."""
    from cell.lab.line import charts, measure, tables

    loaded, folder = load_simulated(args, "study line", pace=None), out_folder(args.out)
    samples = measure.measure(loaded, measure.QUICK if args.quick else measure.FULL)
    lines = measure.measures(samples)
    files = [*measure.write(lines, folder), folder / charts.CHART]
    charts.draw(samples, files[-1])
    return StudyReport([tables.line(lines)], [asdict(each) for each in lines], files)
