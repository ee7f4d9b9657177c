"""`cell study`: one study with its own options."""

import argparse

from cell.commands.arguments import Parser, add_shared, positive, scheduler
from cell.commands.terminal import GOOD, NOT_GOOD, show, written
from cell.lab.arguments import SEED, WORKERS, Plan, seeded, several

METHOD = several("--method", "a method")
SCHEDULER = {"type": scheduler, "metavar": "tcp://HOST:PORT", "help": "address of a Dask cluster that runs the trials"}
STUDIES = {
    "frontier": Plan(
        "cell.lab.frontier.study",
        "speed against accuracy: each method as a curve over its speed, to the point where it fails",
        {
            **seeded(
                "largest number of trials per point, a test ends them early if the answer is clear; default 40, with --quick 1"
            ),
            **METHOD,
            **several("--scene", "a scene"),
            "--scheduler": SCHEDULER,
        },
    ),
    "faults": Plan(
        "cell.lab.faults.study",
        "faults of every kind at every stage: time to rest, force, state, record, and whether production goes on",
        {
            **SEED,
            "--cases": {"type": positive, "metavar": "N", "help": "number of cases, drawn by the seed"},
            **several("--kind", "only kinds whose name contains this text"),
            "--soak": {
                "type": float,
                "default": 0.0,
                "metavar": "HOURS",
                "help": "no faults, but mixed commands for this many simulated hours; measures the growth of memory, handles and threads",
            },
        },
    ),
    "ablation": Plan(
        "cell.lab.ablation.study",
        "what each rule of the method buys: success, time and force without it, on the same seeds",
        {
            **several("--scene", "a scene"),
            **several("--rule", "a rule to switch off"),
            "--most": {
                "type": positive,
                "default": 30,
                "metavar": "N",
                "help": "trials without a rule that always acts; default 30",
            },
            "--frames": {
                "type": positive,
                "metavar": "N",
                "help": "only the rules of the angle, on N frames of each kind",
            },
            **seeded("trials of each scene with all rules; default 40, with --quick 1"),
        },
        has_cell=False,
    ),
    "modelling": Plan(
        "cell.lab.compare",
        "what each model of the stand-in changes: the same trials with one of them in a simpler form",
        {
            **seeded("trials of each variant; default 60, with --quick 1"),
            **several("--only", "a group of variants"),
        },
    ),
    "seating": Plan(
        "cell.lab.seating",
        "holes without a switch: seated parts that are missed, and others taken for seated, by force against depth",
        {**seeded("trials of each case; default 20, with --quick 1"), **several("--case", "a case")},
    ),
    "margins": Plan(
        "cell.lab.margins.study",
        "how large each error may be: the levels at which a method loses a tenth and half of its pegs, by bisection",
        {
            **seeded("trials of each level at most; default 24, with --quick 6"),
            **METHOD,
            **several("--error", "an error"),
        },
    ),
    "stability": Plan(
        "cell.lab.stability",
        "stability limits of the loop through the skin, compared with theory, and the margins of the gains in use",
        WORKERS,
    ),
    "learning": Plan(
        "cell.lab.learning",
        "time by number of the part on a cell that learns where the hole is, beside one that does not and one with a wrong learnt place",
        {
            **seeded("series in each mode; default 10, with --quick 1"),
            "--parts": {"type": positive, "metavar": "N", "help": "parts of one fixture; default 20, with --quick 3"},
        },
    ),
    "events": Plan(
        "cell.lab.events",
        "hole events, false and true: how often a search stops without a hole, and how soon it detects one",
        seeded("searches without a hole; default 1000, with --quick 4"),
    ),
    "tactile": Plan(
        "cell.lab.tactile",
        "reading the peg's angle from the taxels: every estimator's error, its time, and how often its sigma covers the error",
    ),
    "contact": Plan("cell.lab.contact", "models of contact compared: speed, accuracy, and where each fails", WORKERS),
    "limits": Plan(
        "cell.lab.limits",
        "the limit of each phase: the computed bound, and the times of trials",
        seeded("trials; default 24, with --quick 1"),
    ),
    "paper": Plan(
        "cell.lab.paper",
        "the published method under honest errors, beside the published table",
        seeded("trials, on seeds 500 after --seed; default 40 as in [gibbons], with --quick 1"),
    ),
}
"""Studies by name. An installed program lacks `faults`, which attacks cells."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the studies, each with its own arguments."""
    studies = parser.add_subparsers(dest="name", required=True, metavar="NAME", parser_class=Parser)
    for name, study in STUDIES.items():
        if study.is_installed:
            own = studies.add_parser(name, help=study.SUMMARY, description=study.SUMMARY)
            add_shared(own)
            study.add_arguments(own)


def run(args: argparse.Namespace) -> int:
    """Run the study; return NOT_GOOD if it found an ending that must never occur, otherwise GOOD."""
    report = STUDIES[args.name].run(args)
    show(args, report.shown, report.result)
    written(args, report.written)
    return GOOD if report.is_good else NOT_GOOD
