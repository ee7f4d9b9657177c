"""`cell study`: one study with its own options."""

import argparse
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Protocol, cast

from cell.commands.arguments import Parser, add_shared, positive
from cell.commands.terminal import GOOD, NOT_GOOD, show, written
from cell.lab.arguments import Plan

if TYPE_CHECKING:
    from cell.lab.report import StudyReport


class Study(Protocol):
    """A study: a `Plan`, or a module `study.py` that imports its dependencies when it runs."""

    @property
    def SUMMARY(self) -> str:  # noqa: N802 - as in the modules of commands
        """Purpose of the study, in one line for the help."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the study's own arguments to those of every command."""

    def run(self, args: argparse.Namespace) -> "StudyReport":
        """Measure, draw, write, and return the report."""


ONLY = {
    "--only": {"action": "append", "default": [], "metavar": "NAME", "help": "a group of variants; all if not given"}
}
PLANS = {
    "modelling": Plan(
        "cell.lab.compare",
        "what each model of the stand-in changes: the same trials with one of them in a simpler form",
        "trials of each variant; default 60, with --quick 1",
        options=ONLY,
    ),
    "seating": Plan(
        "cell.lab.seating",
        "holes without a switch: seated parts that are missed, and others taken for seated, by force against depth",
        "trials of each case; default 20, with --quick 1",
        options={
            "--case": {"action": "append", "default": [], "metavar": "NAME", "help": "a case; all if not given"},
        },
    ),
    "margins": Plan(
        "cell.lab.margins.study",
        "how large each error may be: the levels at which a method loses a tenth and half of its pegs, by bisection",
        "trials of each level at most; default 24, with --quick 6",
        options={
            "--method": {"action": "append", "metavar": "NAME", "help": "a method; all of them if not given"},
            "--error": {"action": "append", "default": [], "metavar": "NAME", "help": "an error; all if not given"},
        },
    ),
    "stability": Plan(
        "cell.lab.stability",
        "where the loop through the skin goes unstable, beside theory, and the margins of the gains in use",
    ),
    "learning": Plan(
        "cell.lab.learning",
        "time by number of the part on a cell that learns where the hole is, beside one that does not and one told wrongly",
        "series in each mode; default 10, with --quick 1",
        options={
            "--parts": {"type": positive, "metavar": "N", "help": "parts of one fixture; default 20, with --quick 3"}
        },
    ),
    "events": Plan(
        "cell.lab.events",
        "hole events, false and true: how often a search stops without a hole, how soon where there is one",
        "searches without a hole; default 1000, with --quick 4",
    ),
    "tactile": Plan(
        "cell.lab.tactile",
        "reading the peg's angle from the taxels: every estimator's error, time and honesty",
        has_workers=False,
    ),
    "contact": Plan(
        "cell.lab.contact",
        "the ladder of models of contact: how fast, how exact, where each fails",
    ),
    "limits": Plan(
        "cell.lab.limits",
        "what limits each phase: the bound by formula beside what trials of the default and of fast reach",
        "of each preset; default 24, with --quick 1",
    ),
    "paper": Plan(
        "cell.lab.paper",
        "the published method under honest errors, beside the published table",
        "trials, on seeds 500 after --seed; default 40 as in [gibbons], with --quick 1",
    ),
}
"""Studies that are one module."""
PACKAGES = (
    "frontier",
    "faults",
    "ablation",
)
"""Studies that are a package with a module `study`. An installed program lacks `faults`, which attacks cells."""
STUDIES = (*PACKAGES, *PLANS)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the studies, each with its own arguments."""
    studies = parser.add_subparsers(dest="name", required=True, metavar="NAME", parser_class=Parser)
    for name in (name for name in STUDIES if name in PLANS or find_spec(f"cell.lab.{name}")):
        study = load_study(name)
        own = studies.add_parser(name, help=study.SUMMARY, description=study.SUMMARY)
        add_shared(own)
        study.add_arguments(own)


def load_study(name: str) -> Study:
    """Return a study."""
    return PLANS.get(name) or cast(Study, import_module(f"cell.lab.{name}.study"))


def run(args: argparse.Namespace) -> int:
    """Run the study; NOT_GOOD if it found an ending that must never occur, otherwise GOOD."""
    from rich.console import Group

    report = load_study(args.name).run(args)
    show(args, Group(*report.tables), report.result)
    written(args, report.written)
    return GOOD if report.is_good else NOT_GOOD
