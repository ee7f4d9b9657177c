"""`cell trials`: many insertions on fresh simulated cells, one row each."""

import argparse
import json
import os

from cell.commands.arguments import add_config, folder_path, out_folder, positive, scheduler
from cell.commands.terminal import GOOD, show, written
from cell.lab.arguments import SEED, add_options, advancing, load_simulated


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the number of trials, their seeds, their workers and the output folder."""
    add_config(parser)
    add_options(parser, {"--trials": {"type": positive, "default": 40, "metavar": "N"}, **SEED})
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=positive, metavar="N", help="number of processes; default one for each core")
    where.add_argument(
        "--scheduler", type=scheduler, metavar="tcp://HOST:PORT", help="address of a Dask cluster instead"
    )
    parser.add_argument("--out", type=folder_path, required=True, metavar="DIR")


def run(args: argparse.Namespace) -> int:
    """Run the trials, write table, summary and chart, and show the stages beside the published ones."""
    from rich.console import Group

    from cell.lab.charts import CHART, draw_speed_accuracy
    from cell.lab.published import stage_table
    from cell.lab.tables import loads, outcomes, phases, stages
    from cell.lab.trials import SUMMARY, TABLE, run_trials

    config, folder = load_simulated(args).cell, out_folder(args.out)
    seeds, workers = range(args.seed, args.seed + args.trials), args.workers or os.cpu_count() or 1
    with advancing("trials", args.trials) as done:
        rows = run_trials(config, seeds, workers, folder, lambda row: done(1), args.scheduler)
    lines = stage_table([row.tried() for row in rows])
    summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    cycles = [row.cycle_time for row in rows if row.outcome == "success"]
    pace = f"{summary['trials_per_minute']:.1f} trials per minute"
    show(args, Group(stages(lines, cycles), phases(rows), outcomes(rows), loads(rows), pace), summary)
    written(args, [folder / TABLE, folder / SUMMARY, draw_speed_accuracy(lines[-1], folder / CHART)])
    return GOOD
