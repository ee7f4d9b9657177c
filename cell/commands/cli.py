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
    """Contents of a command's module, which is imported only if the command is called."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the command's own arguments to those of every command."""

    def run(self, args: argparse.Namespace) -> int:
        """Run the command and return the exit status; `args.stop` is a `Stop`."""


class Stop(ThreadEvent):
    """Stop flag set by SIGINT, SIGTERM and SIGHUP.

    Once a command has read the flag, a signal only sets it, and the command ends itself.
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
COMPLETION = "completion"
"""Command that needs the arguments of all others."""
COMMANDS = {
    "check": "open every device of a config, read each once, report faults; with --plc, commission cell and PLC",
    "config": "the meaning of a key, the values in force and their origins",
    "demo": "the main job: a PLC peer triggers insertions over Modbus TCP",
    "serve": "obey the PLC until SIGINT or SIGTERM",
    "run": "one skill or program, by hand",
    "watch": "live state of a cell that is served",
    "trials": "many insertions on fresh simulated cells",
    "tune": "search in simulation for a recipe with the required time, force and success",
    "skin": "both fingers live, or as they were recorded",
    "where": "joint angles and tool pose of the arm; the arm holds still",
    "jog": "move the tool by keys along the axes of the base frame",
    "teach": "guide the arm by hand and show places with the end of a peg, for the cell's file",
    "calibrate": "measure skin, arm or places and write a dated file",
    "study": "one study: how fast, how exact, where a method fails",
    "learned": "places of the holes that the cell has learnt; `forget` deletes them",
    "runs": "runs on record, by time, outcome, fault or part",
    "show": "one run on record: how and why it ended, its events and plots",
    "alarms": "faults and warnings on record, with duration and state, by code and period",
    "report": "yield, times, reasons, forces and wear over many runs, of insert_peg, or of the program in --program",
    "compare": "two runs, or the runs of two periods, side by side; for runs also where their configs differ",
    "film": "a run on record as a film, or one picture of it",
    "view": "a run on record, or the one in progress, in MuJoCo's viewer",
    "faults": "every fault code: meaning, cause, what to do",
    "map": "the register map",
    COMPLETION: "a script that lets bash, zsh or tcsh complete commands and options",
}
"""Purpose of each command, for the help; `LABORATORY` names those whose module is in `cell.lab.commands`."""
LABORATORY = ("demo", "trials", "tune", "study")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    try:
        with _signals() as stop:
            args = _parse(list(sys.argv[1:] if arguments is None else arguments))
            args.stop = stop
            with _logging(args), _threads():
                return load_command(args.command).run(args)
    except ConfigError as error:
        return complain(str(error), WRONG_USE)
    except CellError as error:
        return complain(f"fault {error.code.value}: {error}", FAULT)
    except KeyboardInterrupt:
        return complain("stopped")
    except BrokenPipeError:
        # The reader of the output has closed it; redirect the output so that the interpreter's last flush does not fail.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return NOT_GOOD
    except Exception as error:  # a technician must get one line, not a traceback
        if isinstance(error, PermissionError) and error.filename is not None:
            return complain(f"{error.filename}: {error.strerror}", WRONG_USE)
        return complain(f"fault {CellError.code.value}: {type(error).__name__}: {error}; -v shows more", FAULT)


def load_command(name: str) -> CommandModule:
    """Return the module of a command."""
    room = "cell.lab.commands" if name in LABORATORY else "cell.commands"
    return cast(CommandModule, import_module(f"{room}.{name}"))


def _parse(arguments: list[str]) -> argparse.Namespace:
    whole = Parser(
        prog="cell", description="Inserts a loosely held peg by touch. Without --config: the simulated cell."
    )
    whole.add_argument(
        "--version", action=_Version, nargs=0, help="the program's version, and those it was tested with"
    )
    commands = whole.add_subparsers(dest="command", required=True, metavar="COMMAND")
    chosen = next((word for word in arguments if word in COMMANDS), None)
    for name, summary in COMMANDS.items():
        parser = commands.add_parser(name, help=summary, description=summary)
        if chosen in (name, COMPLETION):
            add_shared(parser)
            load_command(name).add_arguments(parser)
    args = whole.parse_args(arguments)
    args.parser = whole
    return args


class _Version(argparse.Action):
    """Print the versions and end the program."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from cell.records.provenance import version_text

        say(version_text())
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


def _again() -> None:
    """Repeat the interrupt a little later: during a callback of the compiler, an exception cannot be raised."""
    # Delay before a lost interrupt is raised again, s.
    again = Timer(0.02, os.kill, (os.getpid(), signal.SIGINT))
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
