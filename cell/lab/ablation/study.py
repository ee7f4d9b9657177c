"""`cell study ablation`: each rule of the method replaced by its simplest form, on paired seeds."""

import argparse
from dataclasses import asdict
from pathlib import Path

from cell.commands.arguments import out_folder, positive
from cell.lab.ablation.rules import RULES, SCENES
from cell.lab.arguments import add_out, add_seed, add_trials, add_workers, advancing
from cell.lab.report import StudyReport, finite

SUMMARY = "what each rule of the method buys: success, time and force without it, on the same seeds"
TABLE, FRAMES = "ablation.csv", "frames.csv"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the scenes, the rules, and the number of trials."""
    add_out(parser)
    parser.add_argument("--quick", action="store_true", help="one trial of a scene")
    parser.add_argument("--scene", action="append", choices=[*SCENES], metavar="S", help="scene; default all")
    parser.add_argument(
        "--rule", action="append", choices=[*RULES], metavar="R", help="rule to switch off; default all"
    )
    parser.add_argument(
        "--most", type=positive, default=30, metavar="N", help="trials without a rule that always acts; default 30"
    )
    parser.add_argument(
        "--frames", type=positive, metavar="N", help="only the rules of the angle, on N frames of each kind"
    )
    add_seed(parser)
    add_trials(parser, "of each scene with all rules; default 40")
    add_workers(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Run every scene with all rules and without each; existing trials are reused."""
    from cell.lab.ablation import measure
    from cell.lab.rows import write_rows
    from cell.lab.tables import plain

    folder = out_folder(args.out)
    if args.frames:
        return _on_frames(args.frames, folder)
    scenes = args.scene or (["honest"] if args.quick else [*SCENES])
    count, rules = (1, args.rule or ["push-back"]) if args.quick else (args.trials or 40, args.rule or ())
    seeds, rows = range(args.seed, args.seed + count), []
    with advancing("trials", None) as done:
        for scene in scenes:
            rows += measure.measure(scene, seeds, args.most, rules, args.workers, folder, lambda: done(1))
    found = measure.effects(rows)
    files = [folder / measure.ROWS, write_rows(found, folder / TABLE)]
    return StudyReport(
        [plain("Effect of each rule: without it, minus with it", found)], finite([asdict(e) for e in found]), files
    )


def _on_frames(count: int, folder: Path) -> StudyReport:
    from cell.lab.ablation import frames
    from cell.lab.rows import write_rows
    from cell.lab.tables import plain

    with advancing("frames", None) as done:
        found = frames.measure(count, lambda: done(1))
    title = "Error of theta on single frames, degrees"
    return StudyReport([plain(title, found)], [asdict(line) for line in found], [write_rows(found, folder / FRAMES)])
