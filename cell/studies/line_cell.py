"""The two servers of the study, each in a process of its own: the whole cell in real time, and a bare one."""

import multiprocessing
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from cell.assembly import assemble, opened
from cell.config import LoadedConfig
from cell.journal import Journal
from cell.line import PARAMETERS, PROGRAMS
from cell.studies.line_client import Address
from cell.supervisor import Supervisor
from drivers.errors import CellError
from plc_bridge.bridge import Bridge
from plc_bridge.messages import Command, Refusal, Report

PATIENCE = 60.0  # s


Scan = tuple[float, int]
"""When a scan asked for commands, s, and the state that it published."""


class _Stopwatch:
    """A line that notes every scan."""

    def __init__(self, bridge: Bridge) -> None:
        self._bridge = bridge
        self._asked = 0.0
        self._is_new = True
        self.scans: list[Scan] = []

    def poll(self) -> Command | None:
        """Ask the bridge."""
        if self._is_new:
            self._asked, self._is_new = time.perf_counter(), False
        return self._bridge.poll()

    def publish(self, report: Report) -> None:
        """Tell the bridge."""
        self.scans.append((self._asked, report.state))
        self._is_new = True
        self._bridge.publish(report)

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Tell the bridge."""
        self._bridge.refuse(command, refusal)


def _serve(loaded: LoadedConfig, connections: int, pipe: Connection) -> None:
    """Serve the cell until the other end has had enough, and send it all scans."""
    plc = loaded.cell.plc
    free = plc.modbus.model_copy(update={"port": 0, "connections": connections})
    bridge, stop = Bridge(plc.model_copy(update={"modbus": free}), PROGRAMS, PARAMETERS), threading.Event()
    stopwatch = _Stopwatch(bridge)

    def wait() -> None:
        pipe.recv()
        stop.set()

    threading.Thread(target=wait, daemon=True).start()
    with (
        tempfile.TemporaryDirectory() as folder,
        Journal(Path(folder)) as journal,
        opened(assemble(loaded.cell)) as cell,
    ):
        bridge.start()
        pipe.send(bridge.address)
        Supervisor(cell, loaded, stopwatch, journal, stop).serve()
        bridge.close()
    pipe.send(stopwatch.scans)


@contextmanager
def cell_process(loaded: LoadedConfig, scans: list[Scan], connections: int) -> Iterator[Address]:
    """Yield where a cell of its own process listens; afterwards `scans` has all that it did."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(loaded, connections, theirs))
    process.start()
    theirs.close()
    try:
        yield _received(ours)
        ours.send(None)
        scans.extend(_received(ours))
    finally:
        process.kill()
        process.join()


def _received(pipe: Connection) -> Any:
    if not pipe.poll(PATIENCE):
        raise CellError("the cell's process does not answer")
    try:
        return pipe.recv()
    except EOFError:
        raise CellError("the cell's process has ended") from None


@contextmanager
def bare_server() -> Iterator[Address]:
    """Yield where pymodbus's own server listens, in a process of its own."""
    command = [sys.executable, "-m", "plc_bridge.bare"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield "127.0.0.1", int(process.stdout.readline())
        process.communicate(timeout=PATIENCE)
