"""mbpoll, a Modbus client that is not ours, on TCP or on a serial line; addresses count from 0."""

import shutil
import subprocess
from collections.abc import Sequence

import pytest

needed = pytest.mark.skipif(shutil.which("mbpoll") is None, reason="mbpoll is not installed (Debian: mbpoll)")
TABLES = {"coil": "0", "discrete": "1", "input": "3", "holding": "4"}


class Mbpoll:
    """mbpoll with the options of one line, which end with the place of the server; it connects anew for every request."""

    def __init__(self, *options: str) -> None:
        *self._options, self._place = options

    @classmethod
    def tcp(cls, address: tuple[str, int]) -> "Mbpoll":
        return cls("-m", "tcp", "-p", str(address[1]), address[0])

    def command(self, kind: str, address: int, *options: str, values: Sequence[int] = ()) -> list[str]:
        """Return the command line that reads a table at an address or writes values there."""
        words = ["-0", *self._options, "-t", TABLES[kind], "-r", str(address), *options]
        return ["mbpoll", *words, self._place, *map(str, values)]

    def said(self, kind: str, address: int, *options: str, values: Sequence[int] = ()) -> tuple[int, str]:
        """Return exit status and output of one request."""
        command = self.command(kind, address, "-1", "-q", *options, values=values)
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        return done.returncode, done.stdout + done.stderr

    def write(self, kind: str, address: int, *values: int) -> None:
        status, said = self.said(kind, address, values=values)
        assert status == 0, said

    def read(self, kind: str, address: int, count: int = 1) -> list[int]:
        status, said = self.said(kind, address, "-c", str(count))
        assert status == 0, said
        return [int(line.split("\t")[1]) for line in said.splitlines() if line.startswith("[")]
