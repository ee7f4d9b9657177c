"""`cell study frontier`: speed against accuracy for presets, settings, and each step from the paper's method."""

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from cell.commands.arguments import out_folder, require_known, scheduler
from cell.commands.terminal import progress
from cell.lab.arguments import add_seed, add_study, add_trials, add_workers, load_simulated
from cell.lab.report import StudyReport, finite

if TYPE_CHECKING:
    from cell.config.cell_config import CellConfig
    from cell.lab.frontier.measure import FrontierLine

SUMMARY = "speed against accuracy: presets, settings, and each step from the paper's method"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell, the groups of variants, the number of trials of each variant, and their workers."""
    add_study(parser)
    add_seed(parser)
    add_trials(
        parser, "most trials of each variant, a test ends them where the answer is clear; default 120, with --quick 2"
    )
    parser.add_argument(
        "--only", action="append", metavar="GROUP", help="a group of variants, as in preset; all else is left out"
    )
    add_workers(parser)
    parser.add_argument(
        "--scheduler", type=scheduler, metavar="tcp://HOST:PORT", help="address of a Dask cluster that runs the trials"
    )
    parser.add_argument("--redraw", action="store_true", help="draw the tables in --out again, run nothing")


def run(args: argparse.Namespace) -> StudyReport:
    """Run every variant on the same seeds, write the table, draw the charts."""
    from cell.lab.frontier import charts, measure, tables
    from cell.lab.rows import read_rows

    config = load_simulated(args, "study frontier").cell
    folder = out_folder(args.out)
    if args.redraw:
        lines = read_rows(measure.FrontierLine, folder / measure.FRONTIER)
        title = (folder / measure.TITLE).read_text(encoding="utf-8").strip()
    else:
        lines, title = _measured(args, config, folder)
    files = [folder / measure.FRONTIER, *charts.draw(lines, title, folder)]
    result = {"title": title, "lines": [asdict(line) for line in lines]}
    return StudyReport([tables.frontier(lines, title), tables.gentleness(lines)], finite(result), files)


def _measured(args: argparse.Namespace, config: "CellConfig", folder: Path) -> "tuple[list[FrontierLine], str]":
    """Run the requested groups; return their lines and the title of the charts.

    Raises:
        ConfigError: A group is unknown.
    """
    from cell.lab.frontier import measure
    from cell.lab.frontier.variants import rate_tests, variants

    seeds = range(args.seed, args.seed + (args.trials or (2 if args.quick else 120)))
    tried = variants(args.config, args.set, args.quick)
    groups = dict.fromkeys(variant.family for variant in tried)
    for name in args.only or ():
        require_known("--only", name, groups)
    tried = [variant for variant in tried if not args.only or variant.family in args.only]
    with progress() as bars:
        bar = bars.add_task("trials", total=len(tried) * len(seeds))
        lines = measure.measure(
            args.config,
            args.set,
            tried,
            seeds,
            args.workers,
            folder,
            lambda count: bars.advance(bar, count),
            rate_tests(),
            args.scheduler,
        )
    counts = sorted({line.trials for line in lines if line.trials}) or [0]
    of_each = f"{counts[0]} to {counts[-1]}" if len(counts) > 1 else f"{counts[0]}"
    title = f"reality {config.reality.scale:g} where nothing else is said; {measure.title_of(seeds, of_each)}"
    (folder / measure.TITLE).write_text(title + "\n", encoding="utf-8")
    return lines, title
