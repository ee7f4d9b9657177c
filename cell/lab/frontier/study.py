"""`cell study frontier`: speed against accuracy, each method as a curve over its speed."""

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from cell.commands.arguments import out_folder, scheduler
from cell.lab.arguments import add_seed, add_study, add_trials, add_workers, advancing, load_simulated
from cell.lab.report import StudyReport, finite

if TYPE_CHECKING:
    from cell.lab.frontier.measure import FrontierLine

SUMMARY = "speed against accuracy: each method as a curve over its speed, to the point where it fails"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell, the methods and scenes, the number of trials of each point, and their workers."""
    add_study(parser)
    add_seed(parser)
    add_trials(parser, "most trials of a point, a test ends them where the answer is clear; default 40, with --quick 1")
    parser.add_argument("--method", action="append", metavar="NAME", help="a method; all of them if not given")
    parser.add_argument("--scene", action="append", metavar="NAME", help="a scene; all of them if not given")
    add_workers(parser)
    parser.add_argument(
        "--scheduler", type=scheduler, metavar="tcp://HOST:PORT", help="address of a Dask cluster that runs the trials"
    )
    parser.add_argument("--redraw", action="store_true", help="draw the table in --out again, run nothing")


def run(args: argparse.Namespace) -> StudyReport:
    """Run every point on the same seeds, write the table, draw the charts."""
    from cell.lab.frontier import charts, measure
    from cell.lab.rows import read_rows
    from cell.lab.tables import plain

    load_simulated(args, "study frontier")
    folder = out_folder(args.out)
    if args.redraw:
        lines = read_rows(measure.FrontierLine, folder / measure.FRONTIER)
        title = (folder / measure.TITLE).read_text(encoding="utf-8").strip()
    else:
        lines, title = _measured(args, folder)
    files = [folder / measure.FRONTIER, *charts.draw(lines, title, folder)]
    result = {"title": title, "lines": [asdict(line) for line in lines]}
    return StudyReport([plain(title, charts.points(lines))], finite(result), files)


def _measured(args: argparse.Namespace, folder: Path) -> "tuple[list[FrontierLine], str]":
    """Run the points; return their lines and the conditions of the trials.

    Raises:
        ConfigError: A method or a scene is unknown.
    """
    from cell.lab.frontier import measure
    from cell.lab.frontier.methods import METHODS, QUICK, SCALES, SCENES, TEST, variants

    seeds = range(args.seed, args.seed + (args.trials or (1 if args.quick else 40)))
    tried = variants(args.method or tuple(METHODS), args.scene or tuple(SCENES), QUICK if args.quick else SCALES)
    with advancing("trials", len(tried) * len(seeds)) as done:
        lines = measure.measure(
            args.config,
            args.set,
            tried,
            seeds,
            args.workers,
            folder,
            done,
            dict.fromkeys((variant.family for variant in tried), TEST),
            args.scheduler,
        )
    counts = sorted(line.trials for line in lines) or [0]
    title = measure.title_of(seeds, f"{counts[0]} to {counts[-1]}")
    (folder / measure.TITLE).write_text(title + "\n", encoding="utf-8")
    return lines, title
