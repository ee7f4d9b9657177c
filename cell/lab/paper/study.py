"""`cell study paper`: the published method under honest errors, beside the published table."""

import argparse
from dataclasses import asdict

from cell.arguments import out_folder
from cell.lab.arguments import add_seed, add_study, add_trials, add_workers, load_simulated
from cell.lab.report import StudyReport, finite
from cell.terminal import progress

SUMMARY = (
    "the published method under honest errors: what is not printed is fitted on half of the seeds, judged on the other"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what is simulated, and the number of trials and candidates."""
    add_study(parser)
    add_seed(parser)
    add_trials(parser, "of each half of the seeds; 20, with --quick 1")
    add_workers(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Run the candidates on the first half of the seeds, judge what fits on the other; finished trials are taken up."""
    from cell.lab.frontier.measure import measure as run_variants
    from cell.lab.frontier.measure import title_of
    from cell.lab.paper import charts, measure, tables

    load_simulated(args, "study paper")
    folder = out_folder(args.out)
    half = args.trials or (1 if args.quick else 20)
    first, second = range(args.seed, args.seed + half), range(args.seed + half, args.seed + 2 * half)
    tried = measure.figures(3 if args.quick else 24)
    with progress() as bars:
        bar = bars.add_task("trials", total=len(tried) * half)

        def of(seeds: range, name: str, numbers: list[int]) -> list[measure.Candidate]:
            variants = [measure.variant(number, name, tried[number]) for number in numbers]
            lines = run_variants(
                args.config, args.set, variants, seeds, args.workers, folder, lambda count: bars.advance(bar, count)
            )
            return [measure.judge(line, tried[n], folder) for line, n in zip(lines, numbers, strict=True)]

        found = of(first, measure.FIT, list(range(len(tried))))
        fits = measure.fitting(found)
        chosen = [int(each.name) for each in fits[: measure.JUDGED]]
        bars.update(bar, total=(len(tried) + len(chosen)) * half)
        judged = of(second, measure.JUDGE, chosen)
    title = f"chosen on seeds {first[0]} to {first[-1]}; judged: {title_of(second)}"
    measure.write([*found, *judged], folder / measure.TABLE)
    files = [folder / measure.TABLE, charts.draw([*found, *judged], title, folder)]
    result = {
        "title": title,
        "fitted": [asdict(each) for each in found],
        "fits": [each.name for each in fits],
        "judged": [asdict(each) for each in judged],
    }
    return StudyReport([tables.stages(judged, title), tables.spread(fits)], finite(result), files)
