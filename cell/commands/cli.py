"""The command line: its commands and their exit status.

Exit status: 0 success, 1 no success, 2 wrong use, 3 fault.
"""

import argparse
import logging
import math
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from threading import Event as ThreadEvent
from threading import Thread, Timer
from typing import Any, Protocol, cast

from cell.commands.arguments import Parser, add_shared
from cell.commands.terminal import FAULT, NOT_GOOD, WRONG_USE, complain, say
from cell.commands.terminal import GOOD as GOOD
from cell.records.patient_log import PatientHandler
from drivers.errors import CellError, ConfigError

logger = logging.getLogger(__name__)


class CommandModule(Protocol):
    """Contents of a command's module; it imports its dependencies when it runs, so that other commands start fast."""

    SUMMARY: str
    """Purpose of the command, in one line for the help."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the command's own arguments to those of every command."""

    def run(self, args: argparse.Namespace) -> int:
        """Run the command and return the exit status; `args.stop` is a `Stop`."""


class Stop(ThreadEvent):
    """Stop flag set by SIGINT, SIGTERM and SIGHUP.

    Once a command has read the flag, a signal only sets it, and the command ends in its own way.
    Before that, for example during imports and compilation, a signal interrupts the command.
    """

    def __init__(self) -> None:
        """Start unset and unread."""
        super().__init__()
        self._is_asked_for = False
        self._taken = math.inf
        """Monotonic time of the first signal after the flag was first read, s; infinite before."""

    def is_set(self) -> bool:
        """Return True if a signal has arrived."""
        self._is_asked_for = True
        return super().is_set()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait up to `timeout` s for a signal; return True if it has arrived."""
        self._is_asked_for = True
        return super().wait(timeout)

    def take(self, *_: object) -> None:
        """Handle a signal.

        Raises:
            KeyboardInterrupt: The command has not read the flag yet, or it still runs after an earlier signal.
                Signals within `REPEATED` count as one, because a closing terminal sends several.
        """
        now = time.monotonic()
        if not self._is_asked_for or now > self._taken + REPEATED:
            raise KeyboardInterrupt
        self._taken = min(self._taken, now)
        # Set on another thread: the interrupted thread may hold the event's lock and would deadlock.
        Thread(target=self.set, name="stop", daemon=True).start()

    def hear(self) -> None:
        """Handle a signal on a thread other than the main one, without an interrupt."""
        if self._is_asked_for:
            self.set()


ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that request the end of a command."""
REPEATED = 1.0
"""Time after a signal within which further signals count as the same, s."""
AGAIN = 0.02
"""Delay before a lost interrupt is raised again, s."""
COMPLETION = "completion"
"""Command that needs the arguments of all others."""
COMMANDS = {
    "check": "cell.commands.check",
    "config": "cell.commands.config",
    "demo": "cell.lab.commands.demo",
    "serve": "cell.commands.serve",
    "run": "cell.commands.run",
    "watch": "cell.commands.watch",
    "trials": "cell.lab.commands.trials",
    "tune": "cell.lab.commands.tune",
    "skin": "cell.commands.skin",
    "where": "cell.commands.where",
    "jog": "cell.commands.jog",
    "teach": "cell.commands.teach",
    "calibrate": "cell.commands.calibrate",
    "study": "cell.lab.commands.study",
    "learned": "cell.commands.learned",
    "runs": "cell.commands.runs",
    "show": "cell.commands.show",
    "alarms": "cell.commands.alarms",
    "report": "cell.commands.report",
    "compare": "cell.commands.compare",
    "film": "cell.commands.film",
    "view": "cell.commands.view",
    "faults": "cell.commands.faults",
    "map": "cell.commands.map",
    COMPLETION: "cell.commands.completion",
}
"""Module of each command; modules of the laboratory are imported only through this table."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    try:
        args = _parse(list(sys.argv[1:] if arguments is None else arguments))
        command = load_command(args.command)
        with _logging(args), _signals() as args.stop, _threads():
            return command.run(args)
    except ConfigError as error:
        return _complain(str(error), WRONG_USE)
    except CellError as error:
        return _complain(f"fault {error.code.value}: {error}", FAULT)
    except KeyboardInterrupt:
        return _complain("stopped", NOT_GOOD)
    except BrokenPipeError:
        # The reader of the output has closed it; redirect the output so that the interpreter's last flush does not fail.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return NOT_GOOD
    except Exception as error:  # a technician must get one line, not a traceback
        return _complain(f"fault {CellError.code.value}: {type(error).__name__}: {error}; -v shows more", FAULT)


def load_command(name: str) -> CommandModule:
    """Return the module of a command."""
    return cast(CommandModule, import_module(COMMANDS[name]))


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
        if chosen in (name, COMPLETION):
            add_shared(parser)
            module.add_arguments(parser)
    args = whole.parse_args(arguments)
    args.parser = whole
    return args


class _Version(argparse.Action):
    """Print the versions and end the program."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from cell.records.versions import told

        say(told())
        parser.exit()


@contextmanager
def _logging(args: argparse.Namespace) -> Iterator[None]:
    """Log to standard error without waiting for its reader, warnings of the interpreter included."""
    level = logging.DEBUG if args.verbose else logging.INFO if args.command == "serve" else logging.ERROR
    handler = PatientHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    logging.basicConfig(level=level, handlers=[handler], force=True)
    logging.captureWarnings(True)  # the interpreter itself would write them and wait for a reader
    try:
        yield
    except CellError:
        raise
    except Exception:  # logged for -v while the log is open, and raised again
        logger.debug("error inside this program", exc_info=True)
        raise
    finally:
        logging.captureWarnings(False)
        handler.flush()
        logging.getLogger().removeHandler(handler)
        handler.close()


@contextmanager
def _heard(stop: Stop) -> Iterator[None]:
    """Receive signals on a second thread: if the main thread hangs outside the interpreter, it runs no handler."""
    ours, its = socket.socketpair()
    its.setblocking(False)

    def listen() -> None:
        while numbers := ours.recv(64):
            if any(number in ENDS for number in numbers):
                stop.hear()

    thread = Thread(target=listen, name="signals", daemon=True)
    thread.start()
    before = signal.set_wakeup_fd(its.fileno(), warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        its.close()
        thread.join()
        ours.close()


@contextmanager
def _threads() -> Iterator[None]:
    """End the command with SIGTERM if a thread ends by an exception: other threads must not wait for it.

    Raises:
        CellError: A thread has ended by an exception.
    """
    lost: list[str] = []

    def note(ended: threading.ExceptHookArgs) -> None:
        if ended.exc_type is SystemExit:
            return
        name = ended.thread.name if ended.thread is not None else "of no name"
        lost.append(f"thread {name} ended: {ended.exc_type.__name__}: {ended.exc_value}")
        logger.error("%s", lost[-1])
        logger.debug("error inside this program", exc_info=ended.exc_value)
        os.kill(os.getpid(), signal.SIGTERM)

    before, threading.excepthook = threading.excepthook, note
    try:
        yield
    finally:
        threading.excepthook = before
        if lost:
            raise CellError(f"{lost[0]}; -v shows more")


def _complain(message: str, status: int) -> int:
    complain(message)
    return status


def _again() -> None:
    """Repeat the interrupt a little later: during a callback of the compiler, an exception cannot be raised."""
    again = Timer(AGAIN, os.kill, (os.getpid(), signal.SIGINT))
    again.daemon = True
    again.start()


@contextmanager
def _signals() -> Iterator[Stop]:
    """Yield the stop flag, with handlers for SIGINT, SIGTERM and SIGHUP installed."""
    stop, tell = Stop(), sys.unraisablehook
    before = {number: signal.signal(number, stop.take) for number in ENDS}
    sys.unraisablehook = lambda lost: _again() if isinstance(lost.exc_value, KeyboardInterrupt) else tell(lost)
    try:
        with _heard(stop):
            yield stop
    finally:
        sys.unraisablehook = tell
        for number, old in before.items():
            signal.signal(number, old)
