"""Both servers of the study, each in its own process: the whole cell in real time, and a bare server."""

import multiprocessing
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from cell.config.load import LoadedConfig
from cell.config.parameters import PARAMETERS
from cell.devices.assembly import assemble, opened
from cell.lab.line.client import Address
from cell.records.journal import Journal
from cell.run.line import PROGRAMS
from cell.run.supervisor import Supervisor
from drivers.errors import CellError
from drivers.protocols import Clock
from plc_bridge.bridge import Bridge
from plc_bridge.config import PlcConfig
from plc_bridge.messages import Command, Report

PATIENCE = 60.0
"""Longest wait for a busy process, and for a PLC that a busy computer delays, s."""


Scan = tuple[float, int]
"""Time at which a scan began to read commands, s, and a state that it published; a scan can publish several."""


class _Stopwatch:
    """A line and a clock that record every scan; a scan begins after a wait."""

    def __init__(self, bridge: Bridge, clock: Clock) -> None:
        self._bridge, self._clock = bridge, clock
        self._asked = 0.0
        self._is_new = True
        self.scans: list[Scan] = []
        self.accept, self.refuse = bridge.accept, bridge.refuse

    def poll(self) -> Command | None:
        """Poll the bridge."""
        if self._is_new:
            self._asked, self._is_new = time.perf_counter(), False
        return self._bridge.poll()

    def publish(self, report: Report) -> None:
        """Publish to the bridge."""
        self.scans.append((self._asked, report.state))
        self._bridge.publish(report)

    def now(self) -> float:
        """Read the clock."""
        return self._clock.now()

    def wait_until(self, stamp: float) -> None:
        """Wait on the clock."""
        self._clock.wait_until(stamp)
        self._is_new = True


@dataclass(frozen=True, slots=True)
class Doors:
    """Addresses of a served cell."""

    plain: Address
    secure: Address | None
    """TLS server; None if it is off."""


def patient(plc: PlcConfig, connections: int) -> PlcConfig:
    """Return settings with which a busy computer loses no run, for this number of connections."""
    free = plc.modbus.model_copy(update={"port": 0, "connections": connections, "connections_per_host": connections})
    return plc.model_copy(update={"modbus": free, "life_timeout": PATIENCE, "lease_timeout": PATIENCE})


def _serve(loaded: LoadedConfig, plc: PlcConfig, pipe: Connection) -> None:
    """Serve the cell until the other end closes, and send it all scans."""
    bridge, stop = Bridge(plc, PROGRAMS, PARAMETERS), threading.Event()

    def wait() -> None:
        pipe.recv()
        stop.set()

    threading.Thread(target=wait, daemon=True).start()
    with (
        tempfile.TemporaryDirectory() as folder,
        Journal(Path(folder)) as journal,
        opened(assemble(loaded.cell)) as cell,
    ):
        stopwatch = _Stopwatch(bridge, cell.clock)
        supervisor = Supervisor(replace(cell, clock=stopwatch), loaded, stopwatch, journal, stop)
        supervisor.scan()
        bridge.start()
        pipe.send(Doors(bridge.address, bridge.secure_address))
        supervisor.serve()
        bridge.close()
    pipe.send(stopwatch.scans)


@contextmanager
def cell_process(loaded: LoadedConfig, scans: list[Scan], plc: PlcConfig) -> Iterator[Doors]:
    """Yield the addresses of a cell in its own process, set up by `plc`; afterwards `scans` contains its scans."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(loaded, plc, theirs))
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
    """Yield the address of pymodbus's own server in a separate process."""
    command = [sys.executable, "-m", "plc_bridge.bare"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield "127.0.0.1", int(process.stdout.readline())
        process.communicate(timeout=PATIENCE)
