"""Options common to all studies, and functions that apply them; this module imports nothing heavy."""

import argparse
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cell.commands.arguments import add_config, folder_path, load_config, natural, positive
from cell.commands.terminal import progress
from drivers.errors import ConfigError

if TYPE_CHECKING:
    from rich.progress import Progress

    from cell.config.load import LoadedConfig
    from cell.lab.report import StudyReport

Options = Mapping[str, Mapping[str, Any]]
"""Arguments of `add_argument` by the name of the option."""
SEED: Options = {
    "--seed": {"type": natural, "default": 1, "metavar": "S", "help": "seed of the first trial; default 1"}
}
WORKERS: Options = {
    "--workers": {
        "type": positive,
        "default": os.cpu_count() or 1,
        "metavar": "N",
        "help": "number of processes; default one for each core",
    }
}
OUT_AND_QUICK: Options = {
    "--out": {
        "type": folder_path,
        "default": Path("out/study"),
        "metavar": "DIR",
        "help": "folder for its files; default out/study",
    },
    "--quick": {"action": "store_true", "help": "less of everything"},
}


def seeded(meaning: str) -> Options:
    """Return the options --seed, --trials and --workers; `meaning` describes the trials and gives their default number."""
    return {**SEED, "--trials": {"type": positive, "metavar": "N", "help": meaning}, **WORKERS}


def several(option: str, meaning: str) -> Options:
    """Return an option that can be given several times."""
    return {option: {"action": "append", "default": [], "metavar": "NAME", "help": f"{meaning}; all if not given"}}


def add_options(parser: argparse.ArgumentParser, options: Options) -> None:
    """Add options to a parser."""
    for name, words in options.items():
        parser.add_argument(name, **words)


@dataclass(frozen=True, slots=True)
class Plan:
    """Help and options of a study, a module with a function `run`; the module is imported when it runs."""

    module: str
    SUMMARY: str
    """Purpose of the study, in one line for the help."""
    options: Options = field(default_factory=dict)
    """Options besides those of every study."""
    has_cell: bool = True
    """True if --config and --set name the cell."""

    @property
    def is_installed(self) -> bool:
        """True if this program has the study."""
        return find_spec(self.module.rpartition(".")[0]) is not None

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the common options and the study's own."""
        if self.has_cell:
            add_config(parser)
        add_options(parser, {**OUT_AND_QUICK, **self.options})

    def run(self, args: argparse.Namespace) -> "StudyReport":
        """Measure, draw, write, and return the report."""
        report: StudyReport = import_module(self.module).run(args)
        return report


def seeds_of(args: argparse.Namespace, trials: int, quick: int = 1) -> range:
    """Return the seeds of --seed and --trials; without --trials, `trials` of them, or `quick` with --quick."""
    return range(args.seed, args.seed + (args.trials or (quick if args.quick else trials)))


@contextmanager
def working() -> "Iterator[Progress]":
    """Compile for this computer, after all arguments are checked, and yield the progress bars."""
    from cell.commands.warm_up import compile_ahead

    compile_ahead()
    with progress() as bars:
        yield bars


@contextmanager
def advancing(name: str, total: int | None, completed: int = 0) -> Iterator[Callable[[int], None]]:
    """Show a bar of progress, and yield a function that advances it by a number."""
    with working() as bars:
        yield partial(bars.advance, bars.add_task(name, total=total, completed=completed))


def load_simulated(args: argparse.Namespace) -> "LoadedConfig":
    """Return the config given by --config and --set, at full speed if --set states no pace.

    Raises:
        ConfigError: The config is invalid, or the cell is not simulated.
    """
    loaded = load_config(args, default_pace="max")
    if not loaded.cell.is_simulated:
        what = f"study {args.name}" if args.command == "study" else args.command
        raise ConfigError(f'{what}: arm.kind = "{loaded.cell.arm.kind}": runs on simulated cells alone; "sim" allowed')
    return loaded
