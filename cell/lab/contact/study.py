"""`cell study contact`: the ladder of contact models, all on the same work."""

import argparse
from dataclasses import asdict

from cell.commands.arguments import out_folder
from cell.commands.terminal import progress
from cell.lab.arguments import add_seed, add_study, add_workers, load_simulated
from cell.lab.report import StudyReport, finite

SUMMARY = "the ladder of models of contact: how fast, how exact, where each fails, what each skill needs"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell and the number of processes."""
    add_study(parser)
    add_seed(parser)
    add_workers(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Measure every rung, write the tables, draw the chart and the map."""
    from cell.lab.contact import charts, ladder, measure, needs, tables

    config, folder = load_simulated(args, "study contact").cell, out_folder(args.out)
    plan = ladder.plan(args.quick, args.workers, config.peg.part)
    with progress() as bars:
        bar = bars.add_task("parts", total=len(plan.rungs) + 3)
        found = measure.run(config, plan, args.seed, lambda name: bars.advance(bar))
    files = [*measure.write(found, folder), *charts.draw(found, folder)]
    result = {
        "rungs": [asdict(row) for row in found.rungs],
        "arm_and_grip": [asdict(row) for row in found.hands],
        "trials": [asdict(row) for row in found.trials],
        "tight": [asdict(row) for row in found.tight],
        "needed": [asdict(row) for row in needs.needed(found)],
    }
    return StudyReport(tables.tables(found), finite(result), files)
