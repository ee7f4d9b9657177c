"""The command line: which commands there are, and how each ends.

Exit status: 0 done and good, 1 done and not good, 2 wrong use, 3 fault.
"""

import argparse
import logging
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from threading import Event as ThreadEvent
from typing import Any, Protocol, cast

from cell.arguments import Parser, add_shared
from cell.terminal import FAULT, NOT_GOOD, WRONG_USE, complain, say
from cell.terminal import GOOD as GOOD
from drivers.errors import CellError, ConfigError

logger = logging.getLogger(__name__)


class Command(Protocol):
    """What the module of a command has; it imports what it needs when it is run, so that no other command pays for it."""

    SUMMARY: str
    """What it does, in one line for the help."""
    STOPS_ITSELF: bool
    """It ends in its own way when `args.stop` is set by SIGINT or SIGTERM; other commands are interrupted."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add its own arguments to those of every command."""

    def run(self, args: argparse.Namespace) -> int:
        """Run it and return the exit status."""


COMMANDS = {
    "check": "cell.commands.check",
    "config": "cell.commands.config",
    "demo": "cell.lab.commands.demo",
    "serve": "cell.commands.serve",
    "run": "cell.commands.run",
    "watch": "cell.commands.watch",
    "trials": "cell.lab.commands.trials",
    "skin": "cell.commands.skin",
    "calibrate": "cell.commands.calibrate",
    "study": "cell.lab.commands.study",
    "runs": "cell.commands.runs",
    "show": "cell.commands.show",
    "film": "cell.commands.film",
    "view": "cell.commands.view",
    "faults": "cell.commands.faults",
    "map": "cell.commands.map",
}
"""Module of each command; those of the laboratory are named here and imported nowhere."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    try:
        args = _parse(list(sys.argv[1:] if arguments is None else arguments))
        _log_to_stderr(logging.DEBUG if args.verbose else logging.INFO if args.command == "serve" else logging.ERROR)
        command = load_command(args.command)
        with _signals(command.STOPS_ITSELF) as args.stop:
            return command.run(args)
    except ConfigError as error:
        return _complain(str(error), WRONG_USE)
    except CellError as error:
        return _complain(f"fault {error.code.value}: {error}", FAULT)
    except KeyboardInterrupt:
        return _complain("stopped", NOT_GOOD)
    except BrokenPipeError:
        # Whoever read our output has left; point it elsewhere so that the interpreter's last flush is quiet too.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return NOT_GOOD
    except Exception as error:
        logger.debug("error inside this program", exc_info=True)
        return _complain(f"fault {CellError.code.value}: {type(error).__name__}: {error}; -v shows more", FAULT)


def load_command(name: str) -> Command:
    """Return the module of a command."""
    return cast(Command, import_module(COMMANDS[name]))


def _parse(arguments: list[str]) -> argparse.Namespace:
    whole = Parser(
        prog="cell", description="Inserts a loosely held peg by touch. Without --config: the simulated cell."
    )
    whole.add_argument(
        "--version", action=_Version, nargs=0, help="the program's version, and those it was tested with"
    )
    commands = whole.add_subparsers(dest="command", required=True, metavar="COMMAND")
    chosen = next((word for word in arguments if word in COMMANDS), None)
    for name in COMMANDS:
        module = load_command(name)
        parser = commands.add_parser(name, help=module.SUMMARY, description=module.SUMMARY)
        if name == chosen:
            add_shared(parser)
            module.add_arguments(parser)
    return whole.parse_args(arguments)


class _Version(argparse.Action):
    """Prints the versions, and ends the program."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from cell.versions import told

        say(told())
        parser.exit()


def _log_to_stderr(level: int) -> None:
    logging.basicConfig(
        stream=sys.stderr, level=level, format="%(asctime)s %(levelname)s %(name)s: %(message)s", force=True
    )


def _complain(message: str, status: int) -> int:
    complain(message)
    return status


@contextmanager
def _signals(stops_itself: bool) -> Iterator[ThreadEvent]:
    """Yield an event that SIGINT and SIGTERM set for a command that stops itself; any other they interrupt."""
    stop = ThreadEvent()
    handler = (lambda *_: stop.set()) if stops_itself else signal.default_int_handler
    before = {number: signal.signal(number, handler) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, old in before.items():
            signal.signal(number, old)
