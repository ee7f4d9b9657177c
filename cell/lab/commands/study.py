"""`cell study`: one study with its own options."""

import argparse
from importlib import import_module
from typing import TYPE_CHECKING, Protocol, cast

from cell.commands.arguments import Parser, add_shared
from cell.commands.terminal import GOOD, NOT_GOOD, show, written

if TYPE_CHECKING:
    from cell.lab.report import StudyReport

SUMMARY = "one study: how fast, how exact, where a method fails"


class Study(Protocol):
    """Interface of a study's module `study.py`; it imports its dependencies when it runs."""

    SUMMARY: str
    """Purpose of the study, in one line for the help."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the study's own arguments to those of every command."""

    def run(self, args: argparse.Namespace) -> "StudyReport":
        """Measure, draw, write, and return the report."""


STUDIES = (
    "speed",
    "contact",
    "line",
    "handshake",
    "wire",
    "tactile",
    "stability",
    "frontier",
    "reality",
    "touch",
    "calibration",
    "paper",
    "events",
    "records",
    "page",
    "faults",
    "learning",
    "opinion",
    "seating",
    "limits",
)
"""Package of each study in the laboratory; each has a module `study`."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the studies, each with its own arguments."""
    studies = parser.add_subparsers(dest="name", required=True, metavar="NAME", parser_class=Parser)
    for name in STUDIES:
        study = load_study(name)
        own = studies.add_parser(name, help=study.SUMMARY, description=study.SUMMARY)
        add_shared(own)
        study.add_arguments(own)


def load_study(name: str) -> Study:
    """Return the module of a study."""
    return cast(Study, import_module(f"cell.lab.{name}.study"))


def run(args: argparse.Namespace) -> int:
    """Run the study; NOT_GOOD if it found an ending that must never occur, otherwise GOOD."""
    from rich.console import Group

    report = load_study(args.name).run(args)
    show(args, Group(*report.tables), report.result)
    written(args, report.written)
    return GOOD if report.is_good else NOT_GOOD
