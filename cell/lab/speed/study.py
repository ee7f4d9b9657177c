"""`cell study speed`: the simulation's speed, and a profile of a trial."""

import argparse
from dataclasses import asdict

from cell.arguments import add_config
from cell.lab.arguments import add_seed, load_simulated
from cell.lab.report import StudyReport

SUMMARY = "how fast the stand-in runs"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what is simulated, and whether a profile is made."""
    add_config(parser)
    add_seed(parser)
    parser.add_argument("--profile", action="store_true", help="where the time of a trial goes")


def run(args: argparse.Namespace) -> StudyReport:
    """Measure one trial on one core."""
    from cell.lab.speed import measure, tables

    config = load_simulated(args, "study speed").cell
    if args.profile:
        parts = measure.profile(config, args.seed)
        return StudyReport([tables.profile(parts)], [asdict(part) for part in parts])
    lines = measure.measure(config, args.seed)
    return StudyReport([tables.speed(lines)], [asdict(line) for line in lines])
