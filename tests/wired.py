"""A whole cell whose skin and switch stand behind their wires, with a hand on the plugs."""

from itertools import count
from typing import Any

import numpy as np

from cell.config.cell_config import CellConfig
from drivers.protocols import Clock
from drivers.skin.board_config import CanSkinConfig
from drivers.skin.boards import CanSkin
from drivers.switch.board import SerialSuccessSwitch
from drivers.switch.board_config import SerialSwitchConfig
from drivers.transport.can_bus import CanBus
from sim.boards.board_clock import BoardClock
from sim.boards.board_links import emulated_can
from sim.boards.switch_board import EmulatedSwitchBoard
from sim.config import WireFaults
from tests.skins import Cabled

_BUSES = count()


class Wires:
    """Skin and switch as their drivers see them: python-can with an emulated hub at its end, pyserial with firmware."""

    def __init__(self, config: CellConfig, source: Any, rng: np.random.Generator) -> None:
        """Put the boards into what `source` sees of a simulated hand and hole."""
        described, name = CanSkinConfig(kind="can", rate=config.skin.rate), f"cell-{next(_BUSES)}"
        self._source = source
        self._hub = emulated_can(described, config.boards.skin, source, rng, 0)
        self._far = CanBus("virtual", name, described.bitrate)
        self.switch_board = EmulatedSwitchBoard(source)
        self.clock: Clock = BoardClock(source, (Cabled(self._hub, self._far), self.switch_board))
        self.skin = CanSkin(described, CanBus("virtual", name, described.bitrate), self.clock)
        self.switch = SerialSuccessSwitch(SerialSwitchConfig(kind="serial", port=self.switch_board.port), self.clock)

    def open(self) -> None:
        self._far.open()
        self._hub.open()
        self.switch_board.open()

    def close(self) -> None:
        self.switch_board.close()
        self._far.close()

    def unplug_skin(self) -> None:
        self._hub.faults = WireFaults(unplugged=((self._source.now(), 1e6),))

    def plug_in_skin(self) -> None:
        self._hub.faults = WireFaults()
