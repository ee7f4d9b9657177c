"""A quick cell that is served over Modbus TCP, and wires to it; a study that the tests of a module share."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from cell.config.load import LoadedConfig
from plc_bridge.config import ModbusConfig, PlcConfig
from tests.plc_wire import Wire
from tests.quick_cell import QuickCell, quick_cell
from tests.studies import studied

CALM = PlcConfig(life_timeout=60.0, lease_timeout=60.0, modbus=ModbusConfig(port=0))
"""So that a busy computer loses no run."""


@pytest.fixture
def served(loaded: LoadedConfig, tmp_path: Path) -> Iterator[QuickCell]:
    """Yield a cell whose one program obeys the test."""
    with quick_cell(loaded, CALM, tmp_path) as served:
        yield served


@pytest.fixture
def connect(served: QuickCell) -> Iterator[Callable[[], Wire]]:
    """Yield what opens a connection to it."""
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


@pytest.fixture(scope="module")
def study(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """Return what the study of a module's `STUDY`, a name and words, printed, and its folder."""
    folder = tmp_path_factory.mktemp("study")
    return studied(folder, *request.module.STUDY), folder
