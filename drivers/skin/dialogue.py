"""The dialogue of host and skin board: discovery, start, and the joining of scans; pure, no I/O and no waiting.

Two dialects stand beside each other: a CySkin hub, whose messages travel over CAN or a serial line, and an iCub board
on CAN. Both give raw scans of the two fingers.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from drivers.quantities import FINGERS, TAXELS, Vector
from drivers.skin.board_config import BOARD_MODULES, FIRST_MODULE, TEMPERATURE, HubConfig, IcubConfig
from drivers.skin.cyskin_wire import (
    Channels,
    HubCommand,
    Message,
    Module,
    ScanAssembler,
    WireError,
    decode_module,
    encode_period,
)
from drivers.skin.health import ERROR_COUNT, Counts
from drivers.skin.icub_wire import TriangleAssembler, TriangleReading, setup
from drivers.skin.layout import MODULE_TAXELS
from drivers.transport.wires import CanFrame

RETRY = 0.1
"""Time between two attempts to get an answer, s."""
START_PERIODS = 3.0
"""Number of periods that a started board has for its first scan."""
SLOWEST = 0.015
"""Longest time that the parts of one scan are under way, s; two modules and two more take 10 ms at 115 200 baud."""
WATCHED_SCANS = 10
LEAST_PERIOD = 0.8
"""Number of scans, and the share of the period, below which a board that sends them too close together is told its period again."""


@dataclass(frozen=True, slots=True, eq=False)
class RawScan:
    """One scan of both fingers, as the board measured it."""

    counts: Counts
    """Readings, counts, shape (2, 20), left finger first; 0 where there is no such channel."""
    temperature: Vector
    """Raw reading of each module, shape (4,), counts; NaN where it has none."""
    stamp: float
    """Time at which the first part came, s."""
    missed: int
    """Number of scans lost right before this one, as far as its sequence number tells."""


class CySkinDialogue:
    """Finds the modules of a hub, starts it, and puts its scans together.

    Args:
        config: Config of the hub.
        period: Wanted time between two scans, s.
    """

    def __init__(self, config: HubConfig, period: float) -> None:
        self._config, self._period = config, period
        self.modules: dict[int, Module] = {}
        """Modules on the hub, by their number on it."""
        self.forget()

    def forget(self) -> None:
        """Forget everything that is known of the board."""
        self.heard = self.refused = self.incomplete = 0
        self.changed = ""
        """Text that names the modules exchanged since the board was first seen; empty while none is."""
        self._first_seen: tuple[int, ...] | None = None
        self.restart()

    def restart(self) -> None:
        """Begin the dialogue again, because the board may have lost power or may never have been there."""
        self._count: int | None = None
        self._channels: Channels | None = None
        self._scans: ScanAssembler | None = None
        self._has_asked = self._is_started = False
        self._next = -math.inf
        self._error: int | None = None
        self._stamps: deque[float] = deque(maxlen=WATCHED_SCANS)
        self.modules.clear()

    def ask(self, now: float) -> list[Message]:
        """Return the messages that are due: first which modules there are, then what each is, then the start, until scans come."""
        if now < self._next or self._is_started:
            return []
        self._next = now + RETRY
        if self._count is None:
            return [Message(HubCommand.DECLARE)]
        if self._channels is None:
            numbers = range(FIRST_MODULE, FIRST_MODULE + self._count)
            return [Message(HubCommand.DETAILS, bytes([n])) for n in numbers if n not in self.modules]
        self._has_asked, self._next = True, now + RETRY + START_PERIODS * self._period
        period = encode_period(self._period, self._config.wire)
        return [Message(HubCommand.PERIOD, period), Message(HubCommand.AUTO_SYNC, b"\1")]

    def take(self, message: Message, stamp: float) -> RawScan | None:
        """Take a message of the hub; return the scan that it completes.

        Args:
            message: Message of the hub.
            stamp: Time of arrival, s.
        """
        try:
            scan = self._take(message, stamp)
        except WireError:
            self.refused += 1
            return None
        self.heard += 1
        return scan

    def trouble(self) -> str:
        """Return what is still missing before scans come, in one line."""
        error = "" if self._error is None else f"; the hub answers with error 0x{self._error:02X}"
        if self._count is None:
            return f"hub {self._config.wire.hub} does not answer{error}"
        if self._channels is None:
            return f"hub {self._config.wire.hub} tells of {len(self.modules)} of its {self._count} modules{error}"
        parts = f"; of {self.incomplete} scans only parts came" if self.incomplete else ""
        return f"hub {self._config.wire.hub} has {len(self.modules)} modules and sends no whole scan{parts}{error}"

    def _take(self, message: Message, stamp: float) -> RawScan | None:
        if message.command == HubCommand.SENSOR_DATA:
            return self._add(message, stamp)
        if message.command == HubCommand.DECLARE and self._count is None:
            if not message.payload or message.payload[0] == 0:
                raise WireError("a hub without modules")
            self._count, self._next = message.payload[0], -math.inf
        elif message.command == HubCommand.DETAILS and self._count is not None:
            module = decode_module(message.payload)
            if not FIRST_MODULE <= module.number < FIRST_MODULE + self._count:
                raise WireError(f"module {module.number} of {self._count}")
            self.modules[module.number] = module
            if len(self.modules) == self._count and self._channels is None:
                self._begin(Channels(list(self.modules.values())))
        elif message.command == HubCommand.ERROR:
            self._error = message.payload[0] if message.payload else 0
        return None

    def _begin(self, channels: Channels) -> None:
        suis = tuple(module.sui for module in channels.modules)
        if self._first_seen is None:
            self._first_seen = suis
        self.changed = (
            ""
            if suis == self._first_seen
            else f"modules {', '.join(map(str, suis))} in place of {', '.join(map(str, self._first_seen))}"
        )
        wanted = self._config.modules or suis[:BOARD_MODULES]
        at = {uid: index for index, uid in enumerate(channels.uid)}
        # The array is one place longer than the hub has channels; modules that are not on the hub read there.
        nowhere = len(channels)
        names = (*self._config.channels, TEMPERATURE)
        place = np.full((BOARD_MODULES, len(names)), nowhere)
        for row, sui in enumerate(wanted):
            place[row] = [at.get(sui << 4 | name, nowhere) for name in names]
        self._taxels = place[:, :-1].reshape(FINGERS, TAXELS)
        self._temperatures = place[:, -1]
        self._channels, self._next = channels, -math.inf
        self._scans = ScanAssembler(len(channels), max(self._period / 2, SLOWEST))

    def _keeps_period(self, stamp: float) -> bool:
        """Return whether scans come no faster than told; a board that missed the command, or started anew, keeps its own period."""
        self._stamps.append(stamp)
        if len(self._stamps) < WATCHED_SCANS:
            return True
        if stamp - self._stamps[0] > LEAST_PERIOD * self._period * (WATCHED_SCANS - 1):
            return True
        self._stamps.clear()
        return False

    def _add(self, message: Message, stamp: float) -> RawScan | None:
        if self._channels is None or self._scans is None or not self._has_asked:
            return None
        part = self._channels.decode(message.payload, self._config.wire)
        lost, incomplete = self._scans.lost, self._scans.incomplete
        scan = self._scans.add(part, message.sequence, stamp)
        self.incomplete += self._scans.incomplete - incomplete
        if scan is None:
            return None
        self._is_started = self._keeps_period(scan[1])
        readings = np.append(scan[0], np.uint16(0))
        temperature = np.append(scan[0].astype(float), np.nan)[self._temperatures]
        return RawScan(readings[self._taxels], temperature, scan[1], self._scans.lost - lost)


class IcubDialogue:
    """Starts an iCub board and joins the triangles of one scan.

    A board numbers no scans: a triangle that comes a second time begins the next one.

    Args:
        config: Config of the board.
    """

    def __init__(self, config: IcubConfig) -> None:
        self._config = config
        self._row = {number: row for row, number in enumerate(config.triangles)}
        self._channels = np.array(config.channels)
        self._begun: dict[int, TriangleReading] = {}
        self._stamp = 0.0
        self.changed = ""
        """Empty text: nothing on such a board tells one triangle from another."""
        self.forget()

    def forget(self) -> None:
        """Forget everything that is known of the board."""
        self._frames = TriangleAssembler(self._config.board)
        self.heard = self.incomplete = 0
        self.restart()

    @property
    def refused(self) -> int:
        """Number of frames that are not of the protocol, or lack their other half."""
        return self._frames.broken

    def restart(self) -> None:
        """Start the board again."""
        self._next, self._is_started = -math.inf, False
        self._begun.clear()

    def ask(self, now: float) -> list[CanFrame]:
        """Return the frame that starts the board, until the board sends."""
        if now < self._next or self._is_started:
            return []
        self._next = now + RETRY
        return [setup(self._config.board)]

    def take(self, frame: CanFrame, stamp: float) -> RawScan | None:
        """Take a frame; return the scan that it completes."""
        triangle = self._frames.feed(frame)
        if triangle is None or triangle[0] not in self._row:
            return None
        self.heard += 1
        self._is_started = True
        number, reading = triangle
        if number in self._begun:
            self.incomplete += 1
            self._begun.clear()
        if not self._begun:
            self._stamp = stamp
        self._begun[number] = reading
        if len(self._begun) < len(self._row):
            return None
        counts = np.full((BOARD_MODULES, MODULE_TAXELS), ERROR_COUNT, dtype=np.uint16)
        for triangle_number, row in self._row.items():
            counts[row] = self._begun[triangle_number].counts()[self._channels]
        self._begun.clear()
        return RawScan(counts.reshape(FINGERS, TAXELS), np.full(BOARD_MODULES, np.nan), self._stamp, 0)

    def trouble(self) -> str:
        """Return what is still missing before scans come, in one line."""
        if not self.heard:
            return f"board {self._config.board} does not send"
        missing = ", ".join(str(n) for n in self._row if n not in self._begun) or "none"
        return f"board {self._config.board} sends no whole scan; missing triangles: {missing}"
