"""Starts of `cell serve` that cost a tenth: forks of a process that has loaded and compiled everything beforehand.

A signal meets such a program as it meets any other; whatever it opens, writes and serves begins after the fork.
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
"""Module whose import loads everything."""
_CONTEXT = multiprocessing.get_context("forkserver")


class Program:
    """A program that serves a cell."""

    def __init__(self, process: "ForkServerProcess", address: tuple[str, int]) -> None:
        """Take the process, and where it listens."""
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
        """Wait for the end, so many s at most, and return the exit status; negative is the signal that killed it.

        Raises:
            CellError: It does not end.
        """
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise CellError(f"the cell does not end within {timeout:g} s")
        return self._process.exitcode


@contextmanager
def served(folder: Path, arguments: Sequence[str]) -> Iterator[Program]:
    """Yield a served cell in a process of its own.

    Raises:
        CellError: It does not start.
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
    """Be the program: what it prints goes to `told`, what it complains of nowhere."""
    from cell.cli import main

    os.dup2(told.fileno(), sys.stdout.fileno())
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())
    sys.exit(main(words))
