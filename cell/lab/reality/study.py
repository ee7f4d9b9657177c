"""`cell study reality`: cost of each error of an honest cell alone, and of all errors combined."""

import argparse
from dataclasses import asdict
from functools import partial

from cell.commands.arguments import out_folder
from cell.commands.terminal import progress
from cell.lab.arguments import add_seed, add_study, add_trials, add_workers, load_simulated
from cell.lab.report import StudyReport, finite

SUMMARY = "errors between the cell that is and the believed one: success, time and force against the size of each"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell, and the number of trials at each scale of each error."""
    add_study(parser)
    add_seed(parser)
    add_trials(parser, "trials of each size at most; default 40, of each row 12, with --quick 1")
    parser.add_argument("--rows", action="store_true", help="instead, a table of named errors, each at one stated size")
    add_workers(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Run every error alone and all combined on the same seeds, write the tables, draw the chart."""
    from cell.lab.frontier.measure import measure as run_variants
    from cell.lab.frontier.measure import title_of
    from cell.lab.reality import charts, measure, tables

    if args.rows:
        return _run_rows(args)
    config = load_simulated(args, "study reality").cell
    folder = out_folder(args.out)
    seeds = range(args.seed, args.seed + (args.trials or (1 if args.quick else 40)))
    errors = measure.errors_of(config)
    tried, going = measure.together(args.quick), measure.drawn_alone(errors, args.quick)
    tests = dict.fromkeys(going, measure.TEST)
    with progress() as bars:
        for scale in measure.SCALES[args.quick]:
            tried = [*tried, *measure.alone(going, scale)]
            bar = bars.add_task(f"trials at up to {scale:g}", total=len(tried) * len(seeds))
            # Finished trials of earlier scales are reused from the folder.
            lines = run_variants(
                args.config,
                args.set,
                tried,
                seeds,
                args.workers,
                folder,
                partial(bars.advance, bar),
                tests,
            )
            going = measure.still_borne(lines)
    title = title_of(seeds, f"at most {len(seeds)}")
    ranks = measure.ranking(errors, measure.rows_together(lines, folder))
    sheet = measure.tolerances(errors, lines)
    files = [folder / measure.TABLE, charts.draw(lines, title, folder)]
    result = {
        "title": title,
        "lines": [asdict(line) for line in lines],
        "tolerances": [asdict(line) for line in sheet],
        "ranking": [asdict(line) for line in ranks],
    }
    shown = [tables.sizes(lines, title), tables.tolerances(sheet), tables.ranking(ranks)]
    return StudyReport(shown, finite(result), files)


def _run_rows(args: argparse.Namespace) -> StudyReport:
    """Run the named rows on the same seeds and write their table."""
    from cell.lab.frontier.measure import title_of
    from cell.lab.reality import measure, rows, tables
    from cell.lab.rows import write_rows

    config = load_simulated(args, "study reality").cell
    folder = out_folder(args.out)
    seeds = range(args.seed, args.seed + (args.trials or (1 if args.quick else 12)))
    tried = rows.ROWS[: rows.QUICK] if args.quick else rows.ROWS
    with progress() as bars:
        bar = bars.add_task("trials", total=len(tried) * len(seeds))
        found = rows.measure(
            rows.TriedCell(args.config, args.set, config, measure.errors_of(config)),
            tried,
            seeds,
            args.workers,
            folder,
            lambda count: bars.advance(bar, count),
        )
    title = f"at most {title_of(seeds)}"
    result = {"title": title, "rows": [asdict(row) for row in found]}
    return StudyReport([tables.rows(found, title)], finite(result), [write_rows(found, folder / rows.ROWS_FILE)])
