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


def scanned(clock, skin, seconds: float):
    """Return the frames read every 10 ms for `seconds`; None while the skin is silent."""
    frames = []
    for _ in range(round(seconds / 0.01)):
        clock.wait_until(clock.now() + 0.01)
        try:
            frames.append(skin.read())
        except SkinSilentError:
            frames.append(None)
    return frames


class SerialEnd(Terminal):
    """The far end of a serial port, with the interface of a bus or line."""

    open, close, write = Terminal.plug_in, Terminal.unplug, Terminal.send

    def read(self, timeout: float) -> bytes:
        assert self._ends is not None
        far, _ = self._ends
        return os.read(far, 4096) if select.select([far], [], [], timeout)[0] else b""


class Cabled:
    """An emulated board on a real bus or line, both open, for a driver at its other end; its clock advances it."""

    def __init__(self, link, far) -> None:
        self._link, self._far = link, far

    def due(self) -> float:
        return self._link.due()

    def advance(self) -> None:
        self._forward()
        self._link.advance()
        self._forward()

    def _forward(self) -> None:
        """Forward what has arrived at either end."""
        while part := self._far.read(0.0):
            self._link.write(part)
        while part := self._link.read(0.0):
            self._far.write(part)


class BoardRig:
    """An emulated board on its wire, the real driver at the other end, and the clock that both keep."""

    def __init__(self, config: CanSkinConfig | SerialSkinConfig, seed: int = 0, **model: object) -> None:
        self.world = ScriptedWorld()
        self.ends: list[CanBus | SerialEnd] = []
        described = SkinBoardConfig.model_validate(model)
        make = emulated_can if isinstance(config, CanSkinConfig) else emulated_line
        self.link = make(config, described, self.world, np.random.default_rng(seed), seed)
        self._drive(config, self.link, self.link)

    def _drive(self, config, near, board) -> None:
        """Put a driver at the near end of the wire; its clock advances the board."""
        self.clock = BoardClock(self.world, (board,))
        self.skin = (CanSkin if isinstance(config, CanSkinConfig) else SerialSkin)(config, near, self.clock)

    def connect_really(self, config: CanSkinConfig | SerialSkinConfig) -> "BoardRig":
        """Put a virtual CAN bus of python-can, or a pseudo-terminal and pyserial, between board and driver."""
        self.link.open()
        name = f"skin-{next(_BUSES)}"
        if isinstance(config, CanSkinConfig):
            far, near = (CanBus("virtual", name, config.bitrate) for _ in range(2))
        else:
            far = SerialEnd(name)
            near = SerialLine(far.port, config.baud_rate)
        far.open()
        self.ends.append(far)
        self._drive(config, near, Cabled(self.link, far))
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

    def scan(self, seconds: float):
        return scanned(self.clock, self.skin, seconds)

    def spied(self):
        """Return a list that receives time, s, and counts of each measurement of the board from now on."""
        measured, real = [], self.hub.measure

        def measure():
            measured.append((self.world.time, real()))
            return measured[-1][1].copy()

        self.hub.measure = measure
        return measured

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
