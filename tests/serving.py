"""A cell that is served, by a thread of this process or as a process of its own, for tests that talk to it over its ports."""

import re
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from cell.config.load import LoadedConfig
from cell.config.parameters import PARAMETERS
from cell.devices.assembly import Cell
from cell.records.journal import Journal
from cell.run.line import PROGRAMS
from cell.run.supervisor import Supervisor
from plc_bridge.bridge import Bridge


@contextmanager
def serving(cell: Cell, loaded: LoadedConfig, folder: Path) -> Iterator[tuple[str, int]]:
    """Yield host and port, a free one, of an opened cell that is served until the end."""
    plc = loaded.cell.plc
    bridge = Bridge(plc.model_copy(update={"modbus": plc.modbus.model_copy(update={"port": 0})}), PROGRAMS, PARAMETERS)
    journal, stop = Journal(folder), threading.Event()
    journal.open()  # here: if another one writes this folder, the test fails at once
    supervisor = Supervisor(cell, loaded, bridge, journal, stop)

    def serve() -> None:
        with closing(journal):
            supervisor.serve()

    bridge.start()
    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield bridge.address
    finally:
        stop.set()
        thread.join()
        bridge.close()


@contextmanager
def process(
    folder: Path,
    sets: Sequence[str],
    *options: str,
    lines: int = 1,
    **how: Any,
) -> Iterator[tuple[subprocess.Popen[str], list[tuple[str, int]]]]:
    """Yield the process of `cell serve` with its records in a folder, and host and port of its first lines; it is killed."""
    words = [word for key in ("plc.modbus.port=0", *sets) for word in ("--set", key)]
    command = [sys.executable, "-m", "cell", "serve", "--journal", str(folder), *words, *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, **how) as running:
        try:
            assert running.stdout is not None
            told = [re.search(r"([\d.]+):(\d+)", running.stdout.readline()) for _ in range(lines)]
            yield running, [(found[1], int(found[2])) for found in told if found is not None]
        finally:
            running.kill()
