"""Skips tests that need the emulated chip if it cannot be built."""

import pytest

from drivers.errors import DeviceNotOpenedError
from sim.boards.switch_board import Chip


def emulated_or_skip() -> None:
    """Skip the test, with the reason, when the chip cannot be emulated here."""
    try:
        Chip().stop()
    except DeviceNotOpenedError as error:
        pytest.skip(str(error))
