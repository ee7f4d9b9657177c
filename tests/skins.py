"""Skins for tests: a scripted world without physics, and boards behind every wire in it."""

import os
import select
from itertools import count

import numpy as np

from drivers.errors import SkinSilentError
from drivers.skin.board_config import CanSkinConfig, SerialSkinConfig
from drivers.skin.boards import CanSkin, SerialSkin
from drivers.transport.can_bus import CanBus
from drivers.transport.serial_line import SerialLine
from sim.boards.board_clock import BoardClock
from sim.boards.board_links import emulated_can, emulated_line
from sim.boards.terminal import Terminal
from sim.config import SkinBoardConfig
from sim.hand.pads import PadLoad
from tests.fakes import FakeClock

_BUSES = count()


class ScriptedWorld(FakeClock):
    """A clock that is a PadSource with a scripted load."""

    def __init__(self) -> None:
        super().__init__()
        self.load: PadLoad | None = None

    def pad_load(self) -> PadLoad | None:
        return self.load


def held_peg(theta: float = 0.3) -> PadLoad:
    return PadLoad(theta, 0.0, 30.0, 0.0, 0.0, 0.05, 0.012, 0.008)


class SerialEnd(Terminal):
    """The far end of a serial port, with the interface of a bus or line."""

    open, close, write = Terminal.plug_in, Terminal.unplug, Terminal.send

    def read(self, timeout: float) -> bytes:
        assert self._ends is not None
        far, _ = self._ends
        return os.read(far, 4096) if select.select([far], [], [], timeout)[0] else b""


class BoardCable:
    """Connects an emulated board to a real bus or line, both open, for a driver at its other end."""

    def __init__(self, board, far) -> None:
        self._board, self._far = board, far

    def advance(self) -> None:
        """Forward what has arrived at either end."""
        while part := self._far.read(0.0):
            self._board.write(part)
        while part := self._board.read(0.0):
            self._far.write(part)


class Cabled:
    """A board at the end of a cable, as its clock sees it."""

    def __init__(self, link, cable) -> None:
        self._link, self._cable = link, cable

    def due(self) -> float:
        return self._link.due()

    def advance(self) -> None:
        self._cable.advance()
        self._link.advance()
        self._cable.advance()


class BoardRig:
    """An emulated board on its wire, the real driver at the other end, and the clock that both keep."""

    def __init__(self, config: CanSkinConfig | SerialSkinConfig, seed: int = 0, **model: object) -> None:
        self.world = ScriptedWorld()
        self.ends: list[CanBus | SerialEnd] = []
        described = SkinBoardConfig.model_validate(model)
        rng = np.random.default_rng(seed)
        if isinstance(config, CanSkinConfig):
            self.link = emulated_can(config, described, self.world, rng, seed)
            self.clock = BoardClock(self.world, (self.link,))
            self.skin: CanSkin | SerialSkin = CanSkin(config, self.link, self.clock)
        else:
            self.link = emulated_line(config, described, self.world, rng, seed)
            self.clock = BoardClock(self.world, (self.link,))
            self.skin = SerialSkin(config, self.link, self.clock)

    def connect_really(self, config: CanSkinConfig | SerialSkinConfig) -> "BoardRig":
        """Put a virtual CAN bus of python-can, or a pseudo-terminal and pyserial, between board and driver."""
        self.link.open()
        name = f"skin-{next(_BUSES)}"
        if isinstance(config, CanSkinConfig):
            far: CanBus | SerialEnd = CanBus("virtual", name, config.bitrate)
            self.clock = BoardClock(self.world, (Cabled(self.link, BoardCable(self.link, far)),))
            self.skin = CanSkin(config, CanBus("virtual", name, config.bitrate), self.clock)
        else:
            far = SerialEnd(name)
            self.clock = BoardClock(self.world, (Cabled(self.link, BoardCable(self.link, far)),))
            self.skin = SerialSkin(config, SerialLine(far.port, config.baud_rate), self.clock)
        far.open()
        self.ends.append(far)
        return self

    def close(self) -> None:
        """Close the driver and the far ends."""
        self.skin.close()
        for end in self.ends:
            end.close()

    @property
    def hub(self):
        """The board's inner life: a hub, or an iCub board itself."""
        return getattr(self.link.board, "hub", self.link.board)

    def scan(self, seconds: float, period: float = 0.01):
        """Return the frames read once a scan for `seconds`; None while the skin is silent."""
        frames = []
        for _ in range(round(seconds / period)):
            self.clock.wait_until(self.clock.now() + period)
            try:
                frames.append(self.skin.read())
            except SkinSilentError:
                frames.append(None)
        return frames

    def unplug(self, seconds: float) -> None:
        """Unplug the board for `seconds` from now on."""
        now = self.clock.now()
        self.link.faults = self.link.faults.model_copy(update={"unplugged": ((now, now + seconds),)})


def can_config(**keys: object) -> CanSkinConfig:
    return CanSkinConfig.model_validate({"kind": "can", **keys})


def serial_config(**keys: object) -> SerialSkinConfig:
    return SerialSkinConfig.model_validate({"kind": "serial", **keys})


_ICUB_ROWS = {
    -223: {5: -386, 4: -129, 2: 129, 1: 386},
    0: {7: -257, 3: 0, 0: 257},
    223: {8: -129, 11: 129},
    446: {9: 0},
}
ICUB_PLACES = {name: (x, y) for y, row in _ICUB_ROWS.items() for name, x in row.items()}
"""Places of the taxels of an iCub triangle, 25 µm. Source: robotology/icub-main a829ee3, Triangle_10pad.h."""
WIRED = {
    "can": can_config(),
    "can_hub_77": can_config(board={"kind": "cyskin", "wire": {"hub": 77}}),
    "serial": serial_config(),
    "serial_100_hz": serial_config(rate=100.0),
    "icub": can_config(rate=25.0, board={"kind": "icub", "board": 3, "triangles": (9, 4, 0, 15)}),
}
"""Boards as they may be wired; all of them give the same skin."""
