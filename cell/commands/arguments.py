"""Options shared by several commands, and the config and journal that these options name; this module imports nothing slow."""

import argparse
import math
import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from cell.commands.terminal import say
from cell.config.nearest import did_you_mean
from cell.records import wall_clock
from cell.records.run_query import OUTCOMES, RunQuery, moment
from drivers.errors import ConfigError, FaultCode

if TYPE_CHECKING:
    from cell.config.cell_config import JournalConfig
    from cell.config.load import LoadedConfig
    from cell.records.journal import Journal

DEVICES = ("arm", "gripper", "skin", "switch")
"""Names of the devices of a cell."""


class Parser(argparse.ArgumentParser):
    """Parser of the command line. It raises a `ConfigError`, so that wrong arguments are reported like any other wrong use."""

    def __init__(self, **options: Any) -> None:
        """Parse each number as an `amount`."""
        super().__init__(**options)
        self.register("type", float, amount)

    def error(self, message: str) -> NoReturn:
        """Raise the error.

        Raises:
            ConfigError: Always.
        """
        raise ConfigError(message)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse the arguments, and report an unknown option before anything else.

        Raises:
            ConfigError: An option or an argument is wrong.
        """
        for word in args or ():
            if word == "--" or (self._subparsers is not None and not word.startswith("-")):
                break  # the rest belongs to a command
            self._require_option(word.split("=", 1)[0])
        return super().parse_known_args(args, namespace)

    def _require_option(self, word: str) -> None:
        known = [name for name in self._option_string_actions if name.startswith("--")]
        if word.startswith("--") and not any(name.startswith(word) for name in known):
            raise ConfigError(f"{word}: no such option of {self.prog}{did_you_mean(word, known)}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None:
            what = "/".join(action.option_strings) or str(action.metavar)
            require_known(what, value, action.choices)


def add_shared(parser: argparse.ArgumentParser) -> None:
    """Add the options of every command."""
    parser.add_argument("-v", "--verbose", action="store_true", help="log everything")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def add_config(parser: argparse.ArgumentParser) -> None:
    """Add --config and --set."""
    parser.add_argument("--config", type=Path, metavar="F", help="TOML file of the cell")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="replace one key")


def add_cell(parser: argparse.ArgumentParser) -> None:
    """Add the options of a cell that records its runs: --config, --set, --journal and --simulate."""
    add_config(parser)
    add_journal(parser)
    parser.add_argument(
        "--simulate",
        type=devices,
        default=(),
        metavar="DEVICES",
        help="simulate these devices instead of those of the config: arm,gripper,skin,switch",
    )


def devices(text: str) -> tuple[str, ...]:
    """Return the device names of a text such as `arm,skin`.

    Raises:
        ConfigError: A name is not that of a device.
    """
    names = tuple(text.split(","))
    for name in names:
        require_known("device", name, DEVICES)
    return names


def add_calibration_folder(parser: argparse.ArgumentParser) -> None:
    """Add --out of a command that writes a measured file."""
    parser.add_argument(
        "--out",
        type=folder_path,
        metavar="DIR",
        help="folder for the file; default calibration/ beside the config file, or among the user's own data",
    )


def calibration_folder(args: argparse.Namespace) -> Path:
    """Return the folder for a measured file: that of --out, else the folder of the proven facts.

    Raises:
        ConfigError: The folder cannot be written.
    """
    return writable(args.out or proven_file(args).parent)


def proven_file(args: argparse.Namespace) -> Path:
    """Return the file with the proven facts: in `calibration` beside the config file, or among the user's own data."""
    from cell.calibrate.proven import FILE
    from cell.records.journal import default_folder

    return (args.config.parent if args.config else default_folder()) / "calibration" / FILE


def load_proven(args: argparse.Namespace) -> "tuple[LoadedConfig, str]":
    """Return the config in force, and the facts that are not proven, in words. If there are any, speed and force are reduced.

    Raises:
        ConfigError: The config is wrong.
    """
    from cell.calibrate.proven import in_force

    return in_force(load_config(args), proven_file(args))


def add_journal(parser: argparse.ArgumentParser) -> None:
    """Add --journal."""
    parser.add_argument("--journal", type=folder_path, metavar="DIR", help="folder of the records of runs")


def add_records(parser: argparse.ArgumentParser) -> None:
    """Add --journal, and --sql of a command that only reads records."""
    add_journal(parser)
    parser.add_argument("--sql", action="store_true", help="print the SQL queries instead of their result")


def load_config(args: argparse.Namespace, default_pace: str | None = None) -> "LoadedConfig":
    """Return the config named by --config and --set, at `default_pace` unless --set replaces it.

    Raises:
        ConfigError: The config is wrong.
    """
    from cell.config.load import load

    sets = list(args.set)
    if default_pace is not None and not any(text.startswith("sim.pace=") for text in sets):
        sets.append(f"sim.pace={default_pace}")
    return load(args.config, sets=sets, simulate=getattr(args, "simulate", ()))


def open_journal(args: argparse.Namespace, config: "JournalConfig") -> "Journal":
    """Return the unopened journal for writing: from --journal, else the config's `folder`, else the user's data folder."""
    from cell.records.journal import Journal, default_folder

    named = Path(config.folder).expanduser() if config.folder else default_folder()
    return Journal(args.journal or named, keep=config)


def read_journal(args: argparse.Namespace) -> "Journal":
    """Return the unopened journal for reading: from --journal, else the user's data folder. With --sql, print its queries.

    Raises:
        ConfigError: The folder of --journal has no journal.
    """
    from cell.records.journal import INDEX, Journal, default_folder

    folder, is_shown = args.journal or default_folder(), getattr(args, "sql", False)
    if args.journal is not None and not (folder / INDEX).exists():
        raise ConfigError(f"--journal {folder}: no {INDEX} there; a folder with the records of runs allowed")
    if is_shown:
        say(f"-- sqlite3 {folder / INDEX}")
    trace = (lambda statement: say(f"{statement.strip()};")) if is_shown else None
    return Journal(folder, is_read_only=True, trace=trace)


def add_period(parser: argparse.ArgumentParser) -> None:
    """Add --since, --until and --fault."""
    parser.add_argument("--since", default="", metavar="WHEN", help="30m, 12h, 7d, 4w back, or a date in local time")
    parser.add_argument("--until", default="", metavar="WHEN", help="end of the period, in the same forms")
    parser.add_argument("--fault", type=fault_code, metavar="CODE", help="number of a fault, as in 2004")


def period_of(args: argparse.Namespace, names: tuple[str, str] = ("--since", "--until")) -> tuple[str, str]:
    """Return `since` and `until` as wall times, ISO 8601 UTC, empty for none; `names` are their options, for messages.

    Raises:
        ConfigError: A text is not a time, or the period does not end after its start.
    """
    now = wall_clock.now()
    since, until = (
        moment(text, now, name) if text else "" for name, text in zip(names, (args.since, args.until), strict=True)
    )
    if until and until <= since:
        raise ConfigError(f"{names[1]} {args.until}: not after {names[0]} {args.since}; a later time allowed")
    return since, until


def add_query(parser: argparse.ArgumentParser) -> None:
    """Add the options that select runs."""
    add_period(parser)
    parser.add_argument("--outcome", choices=OUTCOMES, metavar="WORD", help=f"{', '.join(OUTCOMES)}")
    parser.add_argument("--part", metavar="SERIAL", help="serial number of the part")
    parser.add_argument("--program", metavar="NAME", help="name of the program or skill")
    parser.add_argument("--recipe", type=natural, metavar="N", help="number of the part's recipe")


def query_of(args: argparse.Namespace) -> RunQuery:
    """Return the selection of runs from the options.

    Raises:
        ConfigError: A time in the options is wrong.
    """
    return RunQuery(*period_of(args), args.outcome, args.fault, args.part, args.program, args.recipe)


def fault_code(text: str) -> int:
    """Return the code of a fault.

    Raises:
        ConfigError: The fault does not exist.
    """
    require_known("--fault", text, [str(int(known)) for known in FaultCode if known])
    return int(text)


def require_recipe(number: int, loaded: "LoadedConfig") -> None:
    """Require that a cell has a recipe of this number.

    Raises:
        ConfigError: The recipe does not exist.
    """
    require_known("--recipe", str(number), map(str, loaded.recipes))


def require_program(query: RunQuery) -> None:
    """Require that the program which a query names exists.

    Raises:
        ConfigError: The program does not exist.
    """
    from skills.catalogue import CATALOGUE

    if query.program is not None:
        require_known("--program", query.program, CATALOGUE)


def folder_path(text: str) -> Path:
    """Return the folder that an option names; it may be missing.

    Raises:
        ConfigError: The path, or a parent of it, is a file.
    """
    path = Path(text)
    for each in (path, *path.parents):
        if each.exists() and not each.is_dir():
            raise ConfigError(f"{each}: a folder allowed; this is a file")
    return path


def file_path(text: str) -> Path:
    """Return the file that an option names; it may be missing.

    Raises:
        ConfigError: The path is a folder, or a parent of the path is a file.
    """
    path = Path(text)
    if path.is_dir():
        raise ConfigError(f"{path}: a file allowed; this is a folder")
    return folder_path(str(path.parent)) / path.name


def out_folder(folder: Path) -> Path:
    """Return the output folder of a command; create it if it is missing.

    Raises:
        ConfigError: The folder cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{folder}: cannot be made: {error.strerror}") from None
    return writable(folder)


def writable(folder: Path) -> Path:
    """Return a folder, which may be missing, before a command measures what it writes there.

    Raises:
        ConfigError: No permission to write in the folder, or to make it.
    """
    at = next(each for each in (folder, *folder.absolute().parents) if each.exists())
    if not os.access(at, os.W_OK):
        raise ConfigError(f"{folder}: cannot be written: no permission in {at}")
    return folder


def require_known(what: str, name: str, known: Iterable[str]) -> None:
    """Require a known name; the message calls it `what`.

    Raises:
        ConfigError: The name is unknown.
    """
    known = list(known)
    if name not in known:
        raise ConfigError(f"{what} {name}: no such name; {', '.join(known)} allowed{did_you_mean(name, known)}")


def positive(text: str) -> int:
    """Return a whole number of at least 1."""
    return natural(text, 1)


def natural(text: str, least: int = 0) -> int:
    """Return a whole number of at least `least`."""
    if not text.isdecimal() or int(text) < least:
        raise argparse.ArgumentTypeError(f"{text!r}: a whole number >= {least} allowed")
    return int(text)


def amount(text: str) -> float:
    """Return a finite number of at least 0."""
    with suppress(ValueError):
        if 0.0 <= (value := float(text)) < math.inf:
            return value
    raise argparse.ArgumentTypeError(f"{text!r}: a number >= 0 allowed, as in 1.5")


def address(text: str) -> tuple[str, int]:
    """Return host and port of a text `HOST:PORT`."""
    return _endpoint(text, range(1, 65536), "as in 127.0.0.1:5020")


def listening(text: str) -> tuple[str, int]:
    """Return the host and port of a text `HOST:PORT` to listen on; port 0 selects a free port."""
    return _endpoint(text, range(65536), "as in 127.0.0.1:8080; port 0 selects a free port")


def _endpoint(text: str, ports: range, example: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit() or int(port) not in ports:
        raise argparse.ArgumentTypeError(f"{text!r}: HOST:PORT allowed, {example}")
    return host.strip("[]"), int(port)


def scheduler(text: str) -> str:
    """Return the address of a Dask scheduler unchanged."""
    protocol, _, place = text.partition("://")
    with suppress(argparse.ArgumentTypeError):
        address(place)
        if protocol in ("tcp", "tls"):
            return text
    forms = "tcp://HOST:PORT or tls://HOST:PORT allowed, as in tcp://127.0.0.1:8786"
    raise argparse.ArgumentTypeError(f"{text!r}: {forms}")
