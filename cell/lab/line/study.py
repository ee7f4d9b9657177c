"""`cell study line`: the cell's server beside a bare one, the effect of fifty clients on the scan, and of attacks on a PLC."""

import argparse
from dataclasses import asdict

from cell.commands.arguments import out_folder
from cell.commands.terminal import progress
from cell.lab.arguments import add_study, load_simulated
from cell.lab.report import StudyReport

SUMMARY = "the line to the PLC: answers, commands, the scan beside fifty clients, and a PLC under attack"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the config of the served cell."""
    add_study(parser)
    parser.add_argument("--attacks", action="store_true", help="measure what a PLC feels of attacks, and nothing else")


def run(args: argparse.Namespace) -> StudyReport:
    """Measure in real time, write the figures, draw the distributions."""
    from cell.lab.line import attacks, charts, measure, siege, tables

    loaded, folder = load_simulated(args, "study line", pace=None), out_folder(args.out)
    effort = measure.QUICK if args.quick else measure.FULL
    samples = None if args.attacks else measure.measure(loaded, effort)
    lines = [] if samples is None else measure.measures(samples)
    with progress() as bars:
        bar = bars.add_task("attacks", total=len(attacks.ATTACKS) * effort.tries)
        lines += siege.measures(siege.besiege(loaded, effort.tries, lambda: bars.advance(bar)))
    files = measure.write(lines, folder)
    if samples is not None:
        files.append(folder / charts.CHART)
        charts.draw(samples, files[-1])
    return StudyReport([tables.line(lines)], [asdict(each) for each in lines], files)
