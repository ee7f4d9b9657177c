"""Options common to all studies; imports nothing heavy."""

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from cell.commands.arguments import add_config, load_config, natural, positive

if TYPE_CHECKING:
    from cell.config.load import LoadedConfig


def add_study(parser: argparse.ArgumentParser) -> None:
    """Add the options of every study of a simulated cell: config, output folder, and a shorter run."""
    add_config(parser)
    add_out(parser)
    parser.add_argument("--quick", action="store_true", help="less of everything")


def add_out(parser: argparse.ArgumentParser) -> None:
    """Add --out."""
    parser.add_argument(
        "--out", type=Path, default=Path("out/study"), metavar="DIR", help="folder for its files; default out/study"
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
    loaded.cell.require_simulated(what)
    from cell.commands.warm_up import compile_ahead

    compile_ahead(loaded.cell)
    return loaded
