"""`cell study opinion`: whole trials on an externally described arm, beside the cell's own."""

import argparse
from dataclasses import asdict
from pathlib import Path

from cell.commands.arguments import out_folder
from cell.commands.terminal import progress
from cell.lab.arguments import add_seed, add_study, add_trials, add_workers, load_simulated
from cell.lab.report import StudyReport, finite

SUMMARY = (
    "a second opinion: whole trials on an arm that other people described, beside the cell's own, and what differs"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell, the description, and the number of trials on each arm."""
    add_study(parser)
    add_seed(parser)
    add_trials(parser, "trials on each arm; default 20, with --quick 1 on the described arm alone")
    parser.add_argument(
        "--model",
        type=Path,
        metavar="FILE",
        help="URDF or MJCF file of an arm of seven hinges; the cell believes arm.model. Without it: the FR3 of the package franka-sim",
    )
    parser.add_argument(
        "--flange",
        default="",
        metavar="NAME",
        help="body or site that is the flange, what lies behind it being left out; the usual names if not given",
    )
    add_workers(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Compare the figures, run every arm on the same seeds, write the table."""
    from cell.lab.frontier.measure import title_of
    from cell.lab.opinion import figures, measure, tables
    from sim import described_arm
    from sim.config import DescribedArmConfig

    path = args.model or measure.shipped_description()
    if args.model is None and not any(each.startswith("arm.model") for each in args.set):
        args.set.append(measure.BELIEF)
    arm = load_simulated(args, "study opinion").cell.arm_model()
    described = described_arm.read(DescribedArmConfig(file=path, flange=args.flange), arm)
    folder = out_folder(args.out)
    postures = figures.POSTURES // 20 if args.quick else figures.POSTURES
    compared = figures.compare(arm, described, postures)
    tried = measure.variants(described, path, compared)
    if args.quick:
        tried = tried[-1:]
    seeds = range(args.seed, args.seed + (args.trials or (1 if args.quick else 20)))
    with progress() as bars:
        bar = bars.add_task("trials", total=len(tried) * len(seeds))
        lines = measure.measure(
            args.config, args.set, tried, seeds, args.workers, folder, lambda count: bars.advance(bar, count)
        )
    title = title_of(seeds)
    shown = [
        tables.agreement(compared, described, postures, arm.name),
        tables.joints(compared),
        tables.trials(lines, title),
    ]
    result = {
        "title": title,
        "file": described.name,
        "sha256": described.digest,
        "flange": described.flange,
        "comparison": asdict(compared),
        "lines": [asdict(line) for line in lines],
    }
    return StudyReport(shown, finite(result), [measure.write(lines, folder / measure.TABLE)])
