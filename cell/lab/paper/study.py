"""`cell study paper`: the published method under honest errors, beside the published table."""

import argparse
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

from cell.commands.arguments import out_folder
from cell.commands.terminal import progress
from cell.lab.arguments import add_seed, add_study, add_trials, add_workers, load_simulated
from cell.lab.report import StudyReport, finite

if TYPE_CHECKING:
    from cell.lab.frontier.measure import Variant
    from cell.lab.paper.measure import Candidate
    from cell.lab.trials import TrialRow

SUMMARY = (
    "the published method under honest errors: what is not printed is fitted on half of the seeds, judged on the other"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell, and the number of trials for judging the fit."""
    add_study(parser)
    add_seed(parser)
    add_trials(
        parser, "trials by which the fit is judged, on seeds 500 away; default 40 as in [gibbons], with --quick 1"
    )
    add_workers(parser)
    parser.add_argument(
        "--kept", action="store_true", help="fit nothing: judge the preset as it is, in the laboratory that was found"
    )


def run(args: argparse.Namespace) -> StudyReport:
    """Fit on the first half of the seeds, one stage at a time, and judge on the other; finished trials of the same code are reused."""
    from cell.lab.frontier.measure import measure as run_variants
    from cell.lab.frontier.measure import title_of
    from cell.lab.paper import charts, measure, tables
    from cell.lab.paper.unknowns import LABORATORY
    from cell.lab.trials import TABLE as ROWS
    from cell.lab.trials import read_table

    load_simulated(args, "study paper")
    folder = out_folder(args.out)
    rungs = measure.QUICK if args.quick else measure.RUNGS
    count = args.trials or (1 if args.quick else 40)
    other = range(args.seed + measure.OTHER_HALF, args.seed + measure.OTHER_HALF + count)
    with progress() as bars:
        total = count + (0 if args.kept else measure.number(rungs))
        bar = bars.add_task("trials", total=total)

        def of(variants: "Sequence[Variant]", seeds: Sequence[int]) -> "list[tuple[list[TrialRow], str]]":
            lines = run_variants(
                args.config, args.set, variants, seeds, args.workers, folder, lambda done: bars.advance(bar, done)
            )
            return [(read_table(folder / line.folder / ROWS) if line.trials else [], line.error) for line in lines]

        chosen, found = (LABORATORY, []) if args.kept else measure.fit(of, args.seed, rungs)
        [(rows, error)] = of([measure.variant("kept", measure.JUDGE, chosen)], other)
        judged = measure.judged("kept", chosen, rows, error)
    fitted = "as kept" if args.kept else f"fitted on seeds {args.seed} to {args.seed + 3 * measure.SEEDS - 1}"
    title = f"{fitted}; judged: {title_of(other)}"
    measure.write([*found, judged], folder / measure.TABLE)
    files = [folder / measure.TABLE, charts.draw(found, judged, title, folder)]
    result = {"title": title, "fitted": [_told(each) for each in found], "judged": _told(judged)}
    shown = [tables.stages(judged, title), *([] if args.kept else [tables.spread(found)])]
    return StudyReport(shown, finite(result), files)


def _told(candidate: "Candidate") -> dict[str, Any]:
    return {**asdict(replace(candidate, rows=())), "rows": len(candidate.rows)}
