"""A cell served by a thread of this process, for tests that talk to it over its Modbus port."""

import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from cell.config.load import LoadedConfig
from cell.config.parameters import PARAMETERS
from cell.devices.assembly import Cell
from cell.records.journal import Journal
from cell.run.line import PROGRAMS
from cell.run.supervisor import Supervisor
from plc_bridge.bridge import Bridge


@contextmanager
def serving(
    cell: Cell, loaded: LoadedConfig, folder: Path, begin: threading.Event | None = None
) -> Iterator[tuple[str, int]]:
    """Yield host and port, a free one, of an opened cell that is served until the end.

    The first scan waits for `begin`: with the command already in the mailbox, what follows does not depend on how
    long a client took to send it.
    """
    plc = loaded.cell.plc
    bridge = Bridge(plc.model_copy(update={"modbus": plc.modbus.model_copy(update={"port": 0})}), PROGRAMS, PARAMETERS)
    journal, stop = Journal(folder), threading.Event()
    journal.open()  # here: if another one writes this folder, the test fails at once
    supervisor = Supervisor(cell, loaded, bridge, journal, stop)

    def serve() -> None:
        if begin is not None:
            begin.wait()
        with closing(journal):
            supervisor.serve()

    bridge.start()
    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield bridge.address
    finally:
        stop.set()
        if begin is not None:
            begin.set()
        thread.join()
        bridge.close()
