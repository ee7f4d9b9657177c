"""Starts of `cell serve` at a tenth of the cost: forks of a process that has loaded and compiled all code.

Signals act on such a program as on any other; all files, records and servers are opened after the fork.
"""

import multiprocessing
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

from drivers.errors import CellError

if TYPE_CHECKING:
    from multiprocessing.context import ForkServerProcess

LOADED = "cell.lab.faults.loaded"
"""Module whose import loads all code."""
_CONTEXT = multiprocessing.get_context("forkserver")


class Program:
    """A program that serves a cell."""

    def __init__(self, process: "ForkServerProcess", address: tuple[str, int]) -> None:
        """Store the process and the address of its server."""
        self._process, self.address = process, address

    @property
    def pid(self) -> int:
        """Number of the process."""
        assert self._process.pid is not None
        return self._process.pid

    def signal(self, number: int) -> None:
        """Send a signal."""
        os.kill(self.pid, number)

    def wait(self, timeout: float) -> int:
        """Wait for the end, at most this time, s, and return the exit status; negative is the signal that killed it.

        Raises:
            CellError: The program does not end.
        """
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise CellError(f"the cell does not end within {timeout:g} s")
        return self._process.exitcode


@contextmanager
def served(folder: Path, arguments: Sequence[str]) -> Iterator[Program]:
    """Yield a served cell in a separate process.

    Raises:
        CellError: The cell does not start.
    """
    words = ["serve", "--journal", str(folder), "--set", "plc.modbus.port=0", *arguments]
    _CONTEXT.set_forkserver_preload([LOADED])
    ours, its = _CONTEXT.Pipe(duplex=False)
    process = _CONTEXT.Process(target=_serve, args=(words, its))
    process.start()
    its.close()
    try:
        with os.fdopen(os.dup(ours.fileno()), encoding="utf-8") as told:
            first = told.readline().split()
            if not first:
                raise CellError(f"the cell does not start: cell {' '.join(words)}")
            host, port = first[-1].rsplit(":", 1)
            yield Program(process, (host, int(port)))
    finally:
        process.kill()
        process.join()
        ours.close()


def _serve(words: list[str], told: Connection) -> None:
    """Run the program: its output goes to `told`, its error output is discarded."""
    from cell.commands.cli import main

    os.dup2(told.fileno(), sys.stdout.fileno())
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())
    sys.exit(main(words))
