"""Options that studies share; imports nothing heavy."""

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from cell.arguments import add_config, load_config, natural, positive

if TYPE_CHECKING:
    from cell.config import LoadedConfig


def add_study(parser: argparse.ArgumentParser) -> None:
    """Add the options of every study of a simulated cell: its config, where its files go, and whether it is cut short."""
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
    """Add --trials; `of_what` says what they are, and their number without the option."""
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
    """Return the config that --config and --set name.

    Args:
        args: Parsed options.
        what: Command that needs the config.
        pace: Pace of the simulated cell where --set states none; None leaves it to the file.

    Raises:
        ConfigError: The config is wrong, or the cell is not a simulated one.
    """
    loaded = load_config(args, default_pace=pace)
    loaded.cell.require_simulated(what)
    from cell.warm_up import compile_ahead

    compile_ahead(loaded.cell)
    return loaded
