"""The plugin of pytest: fixtures for a simulated cell; nothing slow is imported before a test uses one."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from cell.testing.simulated import SimulatedCell


@pytest.fixture
def cell_options() -> Sequence[str]:
    """Return options of `cell serve` for the fixture `cell`: --config and --set. Override this fixture to change them."""
    return ()


@pytest.fixture
def cell(cell_options: Sequence[str], tmp_path: Path) -> "Iterator[SimulatedCell]":
    """Yield a simulated cell that is served over Modbus TCP on a free port of this computer, as fast as it can."""
    from cell.testing.simulated import simulated_cell

    with simulated_cell(cell_options, tmp_path / "journal") as served:
        yield served
