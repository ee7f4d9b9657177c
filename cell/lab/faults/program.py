"""Fast starts of `cell serve`: forks of a process that has loaded and compiled all code.

Signals act on such a program as on any other program; it opens all files, records and servers after the fork.
"""

import multiprocessing
import os
import resource
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

from drivers.errors import CellError, ConfigError

if TYPE_CHECKING:
    from multiprocessing.context import ForkServerProcess

LOADED = "cell.lab.faults.loaded"
"""Module whose import loads all code."""
_CONTEXT = multiprocessing.get_context("forkserver")


class ServedProgram:
    """A program that serves a cell."""

    def __init__(self, process: "ForkServerProcess", address: tuple[str, int], secure: tuple[str, int]) -> None:
        """Store the process and the addresses of its server and of its TLS server, if it has one."""
        self._process, self.address, self.secure = process, address, secure

    @property
    def pid(self) -> int:
        """Number of the process."""
        assert self._process.pid is not None
        return self._process.pid

    def signal(self, number: int) -> None:
        """Send a signal."""
        os.kill(self.pid, number)

    def limit(self, most: int = resource.RLIM_INFINITY) -> None:
        """Limit the program's files to `most` bytes each: the effect of a full disk, but only on this program."""
        _, hard = resource.prlimit(self.pid, resource.RLIMIT_FSIZE)
        resource.prlimit(self.pid, resource.RLIMIT_FSIZE, (most, hard))

    def wait(self, timeout: float) -> int:
        """Wait for the program's end, at most `timeout`, s; return the exit status, negative for the signal that killed the program.

        Raises:
            CellError: The program does not end.
        """
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise CellError(f"the cell does not end within {timeout:g} s")
        return self._process.exitcode


@contextmanager
def served(folder: Path, arguments: Sequence[str], tls: Sequence[str] = ()) -> Iterator[ServedProgram]:
    """Yield a served cell in a separate process; `tls` are the config keys of its TLS server, empty for no such server.

    Raises:
        CellError: The cell does not start.
    """
    secure = _free_port()
    tls = [word for key in (f"port={secure}", *tls) for word in ("--set", f"plc.tls.{key}")] if tls else []
    words = ["serve", "--journal", str(folder), "--set", "plc.modbus.port=0", *arguments, *tls]
    _CONTEXT.set_forkserver_preload([LOADED])
    ours, its = _CONTEXT.Pipe(duplex=False)
    process = _CONTEXT.Process(target=serve, args=(words, its))
    process.start()
    its.close()
    try:
        with os.fdopen(os.dup(ours.fileno()), encoding="utf-8") as output:
            first = output.readline().split()
            if not first:
                raise CellError(f"the cell does not start: cell {' '.join(words)}")
            host, port = first[-1].rsplit(":", 1)
            yield ServedProgram(process, (host, int(port)), (host, secure))
    finally:
        process.kill()
        process.join()
        ours.close()


def certificate(folder: Path) -> list[str]:
    """Make a self-signed certificate, and return the config keys of a server with TLS that uses it.

    Raises:
        ConfigError: The program openssl is missing.
    """
    openssl = shutil.which("openssl")
    if openssl is None:
        raise ConfigError("openssl is not installed: the TLS server under attack needs a certificate from it")
    folder = folder.resolve()  # a config's paths are relative to its own folder
    own, key = folder / "cell.pem", folder / "cell.key"
    new = ["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "1"]
    files = ["-subj", "/CN=cell", "-keyout", str(key), "-out", str(own)]
    subprocess.run([openssl, *new, *files], check=True, capture_output=True)
    return [f"certificate={own}", f"key={key}", f"authority={own}"]


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


def serve(words: list[str], output: Connection) -> None:
    """Run the program: send its output to `output`, discard its error output."""
    from cell.commands.cli import main

    os.dup2(output.fileno(), sys.stdout.fileno())
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())
    sys.exit(main(words))
