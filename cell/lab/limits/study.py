"""`cell study limits`: the limit of each phase of an insertion, by formula, beside the trials' results."""

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from cell.commands.arguments import out_folder
from cell.commands.terminal import progress
from cell.lab.arguments import add_seed, add_study, add_trials, add_workers, load_simulated
from cell.lab.report import StudyReport, finite

if TYPE_CHECKING:
    from cell.lab.limits.cases import Case

SUMMARY = "what limits each phase: the bound by formula beside what trials of what ships and of fast reach"
TABLE, TITLE = "limits.csv", "title.txt"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell, the number of trials of each case, and their workers."""
    add_study(parser)
    add_seed(parser)
    add_trials(parser, "of each case; 24, with --quick 1 of two cases")
    add_workers(parser)
    parser.add_argument("--redraw", action="store_true", help="draw the rows in --out again, run nothing")


def run(args: argparse.Namespace) -> StudyReport:
    """Run every case on the same seeds, write rows and table, draw the chart; existing rows are reused."""
    from cell.lab.frontier.measure import load_variant
    from cell.lab.limits import charts, lines, measure, tables
    from cell.lab.limits.cases import cases
    from cell.lab.rows import write_rows

    load_simulated(args, "study limits")
    folder = out_folder(args.out)
    tried = cases(bool(args.config or args.set), args.quick)
    title = _title(folder) if args.redraw else _measured(args, tried, folder)
    configs = {
        case.name: load_variant(args.config, case.variant.preset, [*args.set, *case.variant.sets]) for case in tried
    }
    studies = lines.studies(tried, configs, measure.read_rows(folder / measure.ROWS))
    found = [line for study in studies for line in study.lines()]
    write_rows(found, folder / TABLE)
    files = [folder / measure.ROWS, folder / TABLE, charts.draw(studies, title, folder)]
    return StudyReport(
        [tables.limits(found, title)], finite({"title": title, "lines": [asdict(line) for line in found]}), files
    )


def _measured(args: argparse.Namespace, tried: "list[Case]", folder: Path) -> str:
    """Run missing trials and return the chart's title."""
    from cell.lab.frontier.measure import title_of
    from cell.lab.limits import measure

    seeds = range(args.seed, args.seed + (args.trials or (1 if args.quick else 24)))
    with progress() as bars:
        bar = bars.add_task("trials", total=len(tried) * len(seeds))
        measure.measure(
            args.config, args.set, tried, seeds, args.workers, folder, lambda count: bars.advance(bar, count)
        )
    title = title_of(seeds).replace("a variant", "a case")
    (folder / TITLE).write_text(title + "\n", encoding="utf-8")
    return title


def _title(folder: Path) -> str:
    """Return the title of an earlier call; if it is missing, the rows are those of an interrupted call."""
    path = folder / TITLE
    return path.read_text(encoding="utf-8").strip() if path.exists() else "an ended call"
