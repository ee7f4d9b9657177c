"""What the options of several commands share: their types, the config and the journal that they name; imports nothing heavy."""

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from cell.nearest import did_you_mean
from drivers.errors import ConfigError

if TYPE_CHECKING:
    from cell.config import LoadedConfig
    from cell.journal import Journal


class Parser(argparse.ArgumentParser):
    """Raises what is wrong, so that it is told like any other wrong use, and names what may have been meant."""

    def error(self, message: str) -> NoReturn:
        """Raise.

        Raises:
            ConfigError: Always.
        """
        raise ConfigError(message)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            known = [str(choice) for choice in action.choices]
            what = action.metavar if isinstance(action.metavar, str) else "/".join(action.option_strings)
            raise ConfigError(f"{what} {value}: {', '.join(known)} allowed{did_you_mean(str(value), known)}")


def add_shared(parser: argparse.ArgumentParser) -> None:
    """Add what every command has."""
    parser.add_argument("-v", "--verbose", action="store_true", help="log everything")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def add_config(parser: argparse.ArgumentParser) -> None:
    """Add --config and --set."""
    parser.add_argument("--config", type=Path, metavar="F", help="TOML file of the cell")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="replace one key")


def add_journal(parser: argparse.ArgumentParser) -> None:
    """Add --journal."""
    parser.add_argument("--journal", type=Path, metavar="DIR", help="folder of the records of runs")


def load_config(args: argparse.Namespace, default_pace: str | None = None) -> "LoadedConfig":
    """Return the config that --config and --set name, at `default_pace` unless --set says another.

    Raises:
        ConfigError: Something in it is wrong.
    """
    from cell.config import load

    sets = list(args.set)
    if default_pace is not None and not any(text.startswith("sim.pace=") for text in sets):
        sets.append(f"sim.pace={default_pace}")
    return load(args.config, sets=sets)


def open_journal(args: argparse.Namespace, folder: str = "") -> "Journal":
    """Return the journal that --journal names, else the one in the config's `folder`, else the user's own; not yet open."""
    from cell.journal import Journal, default_folder

    return Journal(args.journal or (Path(folder).expanduser() if folder else default_folder()))


def out_folder(folder: Path) -> Path:
    """Return the folder that a command writes to, made if need be.

    Raises:
        ConfigError: It cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{folder}: cannot be made: {error.strerror}") from None
    return folder


def require_known(what: str, name: str, known: Iterable[str]) -> None:
    """Make sure that a name is a known one.

    Raises:
        ConfigError: It is not; `what` says of what.
    """
    known = list(known)
    if name not in known:
        raise ConfigError(f"{what} {name}: no such name; {', '.join(known)} allowed{did_you_mean(name, known)}")


def positive(text: str) -> int:
    """Return a whole number of at least 1."""
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: a whole number >= 1 allowed")
    return int(text)


def natural(text: str) -> int:
    """Return a whole number of at least 0."""
    if not text.isdigit():
        raise argparse.ArgumentTypeError(f"{text!r}: a whole number >= 0 allowed")
    return int(text)


def address(text: str) -> tuple[str, int]:
    """Return host and port of `HOST:PORT`."""
    host, colon, port = text.rpartition(":")
    if not colon or not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise argparse.ArgumentTypeError(f"{text!r}: HOST:PORT allowed, as in 127.0.0.1:5020")
    return host.strip("[]"), int(port)


def scheduler(text: str) -> str:
    """Return the address of a Dask scheduler as it is."""
    protocol, colon, place = text.partition("://")
    try:
        address(place)
    except argparse.ArgumentTypeError:
        colon = ""
    if not colon or protocol not in ("tcp", "tls"):
        raise argparse.ArgumentTypeError(
            f"{text!r}: tcp://HOST:PORT or tls://HOST:PORT allowed, as in tcp://127.0.0.1:8786"
        )
    return text
