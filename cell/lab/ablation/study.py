"""`cell study ablation`: each rule of the method replaced by its simplest form, on paired seeds."""

import argparse

from cell.commands.arguments import out_folder, require_known
from cell.lab.ablation import frames
from cell.lab.ablation.measure import Effect, measure
from cell.lab.ablation.rules import RULES, SCENES
from cell.lab.arguments import advancing, seeds_of
from cell.lab.report import StudyReport, reported
from cell.lab.tables import plain


def run(args: argparse.Namespace) -> StudyReport:
    """Run every scene with all rules and without each; existing trials are reused.

    Raises:
        ConfigError: A scene or a rule is unknown.
    """
    for option, names, known in (("--scene", args.scene, SCENES), ("--rule", args.rule, RULES)):
        for name in names:
            require_known(option, name, known)
    folder = out_folder(args.out)
    if args.frames:
        with advancing("frames", None) as done:
            lines = frames.measure(args.frames, done)
        shown = plain("Error of theta on single frames, degrees", lines)
        return reported(shown, folder, {"frames.csv": lines}, lines=lines)
    scenes = args.scene or (["honest"] if args.quick else [*SCENES])
    rules, seeds = args.rule or (["push-back"] if args.quick else ()), seeds_of(args, 40)
    found = list[Effect]()
    with advancing("trials", None) as done:
        for scene in scenes:
            found += measure(scene, seeds, args.most, rules, args.workers, folder, lambda row: done(1))
    shown = plain("Effect of each rule: without it, minus with it", found)
    return reported(shown, folder, {"ablation.csv": found}, effects=found)
