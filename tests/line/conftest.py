"""A quick cell that is served over Modbus TCP, wires to it and its page."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from cell.config.load import LoadedConfig
from cell.page.server import PageServer
from tests.plc_lines import patient
from tests.plc_wire import Wire
from tests.quick_cell import QuickCell, quick_cell


@pytest.fixture
def served(loaded: LoadedConfig, tmp_path: Path) -> Iterator[QuickCell]:
    """Yield a cell whose one program obeys the test."""
    with quick_cell(loaded, patient(), tmp_path) as served:
        yield served


@pytest.fixture
def connect(served: QuickCell) -> Iterator[Callable[[], Wire]]:
    """Yield a function that opens a connection to it."""
    opened = []

    def connect() -> Wire:
        opened.append(Wire(served.bridge.address))
        return opened[-1]

    yield connect
    for wire in opened:
        wire.close()


@pytest.fixture
def plc(connect: Callable[[], Wire]) -> Wire:
    """Return the connection of a PLC."""
    return connect()


@pytest.fixture
def server(served: QuickCell, loaded: LoadedConfig) -> Iterator[PageServer]:
    """Yield the page of it, on which the cable of the skin can be pulled."""
    with PageServer(("127.0.0.1", 0), served.bridge, served.live, loaded, served.folder, ["skin"]) as made:
        yield made
