"""Options common to all studies, and what every study does with them; imports nothing heavy."""

import argparse
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cell.commands.arguments import add_config, folder_path, load_config, natural, positive
from cell.commands.terminal import progress
from drivers.errors import ConfigError

if TYPE_CHECKING:
    from rich.progress import Progress

    from cell.config.load import LoadedConfig
    from cell.lab.report import StudyReport


@dataclass(frozen=True, slots=True)
class Plan:
    """Help and options of a study that is one module with a function `run`; the module is imported when it runs."""

    module: str
    SUMMARY: str
    """Purpose of the study, in one line for the help."""
    trials: str = ""
    """Meaning of --trials, with the default; empty if the study has no seeds."""
    has_workers: bool = True
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """Options of its own, each with the arguments of `add_argument`."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the common options and the study's own."""
        add_study(parser)
        if self.trials:
            add_seed(parser)
            add_trials(parser, self.trials)
        if self.has_workers:
            add_workers(parser)
        for name, words in self.options.items():
            parser.add_argument(name, **words)

    def run(self, args: argparse.Namespace) -> "StudyReport":
        """Measure, draw, write, and return the report."""
        report: StudyReport = import_module(self.module).run(args)
        return report


def seeds_of(args: argparse.Namespace, trials: int, quick: int = 1) -> range:
    """Return the seeds of --seed and --trials; without --trials, `trials` of them, or `quick` with --quick."""
    return range(args.seed, args.seed + (args.trials or (quick if args.quick else trials)))


@contextmanager
def working() -> "Iterator[Progress]":
    """Compile for this computer, which must not come before an argument is refused, and yield the bars of the work."""
    from cell.commands.warm_up import compile_ahead

    compile_ahead()
    with progress() as bars:
        yield bars


@contextmanager
def advancing(name: str, total: int | None) -> Iterator[Callable[[int], None]]:
    """Show a bar of progress, and yield a function that advances it by a number."""
    with working() as bars:
        yield partial(bars.advance, bars.add_task(name, total=total))


def add_study(parser: argparse.ArgumentParser) -> None:
    """Add the options of every study of a simulated cell: config, output folder, and a shorter run."""
    add_config(parser)
    add_out(parser)
    parser.add_argument("--quick", action="store_true", help="less of everything")


def add_out(parser: argparse.ArgumentParser) -> None:
    """Add --out."""
    parser.add_argument(
        "--out",
        type=folder_path,
        default=Path("out/study"),
        metavar="DIR",
        help="folder for its files; default out/study",
    )


def add_seed(parser: argparse.ArgumentParser) -> None:
    """Add --seed."""
    parser.add_argument("--seed", type=natural, default=1, metavar="S", help="seed of the first trial; default 1")


def add_trials(parser: argparse.ArgumentParser, of_what: str) -> None:
    """Add --trials; `of_what` describes the trials and gives their default number."""
    parser.add_argument("--trials", type=positive, metavar="N", help=of_what)


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Add --workers."""
    parser.add_argument(
        "--workers",
        type=positive,
        default=os.cpu_count() or 1,
        metavar="N",
        help="number of processes; default one for each core",
    )


def load_simulated(args: argparse.Namespace, what: str, pace: str | None = "max") -> "LoadedConfig":
    """Return the config given by --config and --set.

    Args:
        args: Parsed options.
        what: Command that needs the config.
        pace: Pace of the simulated cell if --set states none; None keeps the file's.

    Raises:
        ConfigError: The config is invalid, or the cell is not simulated.
    """
    loaded = load_config(args, default_pace=pace)
    if not loaded.cell.is_simulated:
        raise ConfigError(f'{what}: arm.kind = "{loaded.cell.arm.kind}": runs on simulated cells alone; "sim" allowed')
    return loaded
