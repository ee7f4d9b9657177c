"""`cell study wire`: the wires of skin and switch, alone and with whole insertions."""

import argparse
import json
from dataclasses import asdict

from cell.commands.arguments import out_folder
from cell.commands.terminal import progress
from cell.lab.arguments import add_seed, add_study, add_trials, add_workers, load_simulated
from cell.lab.report import StudyReport

SUMMARY = "the wires of skin and switch: decoding, age, recovery, whole insertions through each"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulated cell, and the number of insertions through each wire."""
    add_study(parser)
    add_seed(parser)
    add_trials(parser, "insertions through each wire; default 20, with --quick 2")
    add_workers(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Measure, and write the figures and every wire's rows."""
    from cell.lab.tables import plain
    from cell.lab.wire import measure

    config, folder = load_simulated(args, "study wire").cell, out_folder(args.out)
    seeds = range(args.seed, args.seed + (2 if args.quick else args.trials or 20))
    with progress() as bars:
        bar = bars.add_task("insertions", total=len(measure.TRIED) * len(seeds))
        measures = measure.measure(config, seeds, args.workers, folder, args.quick, lambda row: bars.advance(bar))
    data = {name: [asdict(line) for line in lines] for name, lines in measures.items()}
    file = folder / "wire.json"
    file.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
    return StudyReport([plain(name, lines) for name, lines in measures.items()], data, [file])
