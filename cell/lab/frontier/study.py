"""`cell study frontier`: speed against accuracy, each method as a curve over its speed."""

import argparse

from cell.lab.arguments import load_simulated, seeds_of
from cell.lab.compare import compared
from cell.lab.frontier.charts import POINTS, draw
from cell.lab.frontier.methods import METHODS, QUICK, SCALES, SCENES, TEST, variants
from cell.lab.report import StudyReport, reported
from cell.lab.tables import table

TABLE = "frontier.csv"


def run(args: argparse.Namespace) -> StudyReport:
    """Run every point on the same seeds, write the table, draw the charts.

    Raises:
        ConfigError: A method or a scene is unknown.
    """
    load_simulated(args, "study frontier")
    tried = variants(args.method or tuple(METHODS), args.scene or tuple(SCENES), QUICK if args.quick else SCALES)
    found = compared(args, tried, seeds_of(args, 40), TABLE, TEST)
    shown = table(found.title, {"curve": lambda line: line.family}, POINTS, found.lines)
    charts = draw(found.lines, found.title, found.folder)
    return reported(shown, found.folder, {TABLE: found.lines}, charts, title=found.title, lines=found.lines)
