"""A simulated cell in a thread of a test, with the faults that a test can cause."""

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from cell.commands.arguments import Parser, add_config, load_config
from cell.commands.warm_up import warm_up
from cell.config.load import LoadedConfig
from cell.config.parameters import PARAMETERS
from cell.devices.assembly import Cell, assemble, opened
from cell.records.journal import Journal
from cell.records.schema import RunRow
from cell.run.line import PROGRAMS, WORDS
from cell.run.supervisor import Supervisor
from drivers.errors import ConfigError
from plc_bridge.bridge import Bridge
from plc_bridge.protocol.registers import Register, table
from sim.boards.faulty import FaultyDevice, kept

PATIENT = ("--set", "plc.life_timeout=10", "--set", "plc.lease_timeout=10")
"""Options that come first: simulated time passes faster than a busy computer's, so that shipped limits would end runs."""


class SimulatedCell:
    """A served cell, as a test sees it.

    The faults last until `repair`. They take effect with the next scan.
    """

    def __init__(self, cell: Cell, bridge: Bridge, journal: Journal) -> None:
        """Put the devices that can fail into the cell."""
        self._arm, self._switch, self._skin = FaultyDevice(cell.arm), FaultyDevice(cell.switch), cell.cables["skin"]
        self._journal, self.has_ended = journal, threading.Event()
        self.cell = replace(cell, arm=self._arm, switch=self._switch)
        """The cell with those devices."""
        self.address: tuple[str, int] = bridge.address
        """Host and port of its Modbus TCP server."""
        self.map: dict[str, Register] = {register.name: register for register in table(PROGRAMS, PARAMETERS, WORDS)}
        """Registers by name, as `cell map` prints them."""

    @property
    def runs(self) -> list[RunRow]:
        """Records of all runs, the oldest first."""
        return sorted(self._journal.runs(-1), key=lambda row: row.run)

    def unplug_skin(self) -> None:
        """Unplug the cable of the tactile skin."""
        self._skin.is_unplugged = True

    def jam_switch(self) -> None:
        """Jam the switch under the hole in its present state."""
        self._switch.change = kept()

    def empty_rack(self) -> None:
        """Take every peg out of the rack: the next run finds none. REFILLED fills it again, as `repair` does."""
        self.cell.empty()

    def freeze_arm(self) -> None:
        """Repeat the arm's present state as if it were new, until the repair, while the arm continues to move."""
        self._arm.change = kept("q", "dq", "tcp", "wrench")

    def repair(self) -> None:
        """End every fault, and return when the cell has readings again; the PLC still has to reset it."""
        self._skin.is_unplugged = False
        self._arm.change = self._switch.change = lambda reading: reading
        self.cell.refill()
        # Time in which every device that is repaired has returned readings again, s of the cell's clock.
        end = self.cell.clock.now() + 0.5
        # Time between two reads of that clock, s.
        while self.cell.clock.now() < end and not self.has_ended.wait(0.001):
            pass


@contextmanager
def simulated_cell(options: Sequence[str], folder: Path) -> Iterator[SimulatedCell]:
    """Yield a simulated cell that is served until the end.

    Args:
        options: Options of `cell serve`, --config and --set.
        folder: Folder of its records.

    Raises:
        CellError: The config is wrong, or the cell could not go on.
    """
    loaded, stop = _loaded(options), threading.Event()
    warm_up(loaded)
    bridge, failed = Bridge(loaded.cell.plc, PROGRAMS, PARAMETERS), list[BaseException]()
    with Journal(folder) as journal:
        bridge.start()
        served = SimulatedCell(assemble(loaded.cell), bridge, journal)
        supervisor = Supervisor(served.cell, loaded, bridge, journal, stop)

        def serve() -> None:
            try:
                supervisor.serve()
            except BaseException as error:  # passed to the test, which would wait for ever
                failed.append(error)
            finally:
                served.has_ended.set()

        thread = threading.Thread(target=serve, name="cell")
        try:
            with opened(served.cell):
                supervisor.scan()
                thread.start()
                try:
                    yield served
                finally:
                    stop.set()
                    thread.join()
        finally:
            bridge.close()
    if failed:
        raise failed[0]


def _loaded(options: Sequence[str]) -> LoadedConfig:
    """Return the config of the options, with a server on a free port of this computer.

    Raises:
        ConfigError: The config is wrong, or it is that of a real cell.
    """
    parser = Parser(prog="cell_options")
    add_config(parser)
    loaded = load_config(parser.parse_args([*PATIENT, *options]), default_pace="max")
    if not loaded.cell.is_simulated:
        raise ConfigError("cell_options: the config of a real cell; that of a simulated one allowed")
    plc = loaded.cell.plc
    server = plc.modbus.model_copy(update={"host": "127.0.0.1", "port": 0})
    cell = loaded.cell.model_copy(update={"plc": plc.model_copy(update={"modbus": server})})
    return replace(loaded, recipes={**loaded.recipes, 0: cell})
