"""One wire with one skin board: it receives raw scans, and sends the messages that start the board."""

import math
from collections import defaultdict
from typing import Protocol

import numpy as np

from drivers.protocols import Device
from drivers.quantities import FINGERS
from drivers.skin.board_config import BOARD_MODULES, HubConfig, IcubConfig
from drivers.skin.cyskin_wire import ALL_HUBS, LONGEST, CanAssembler, HubCommand, Message, encode, sender, to_can
from drivers.skin.dialogue import RETRY, CySkinDialogue, RawScan
from drivers.skin.health import ERROR_COUNT
from drivers.skin.icub_wire import TriangleAssembler, TriangleReading, setup
from drivers.skin.layout import MODULE_TAXELS
from drivers.transport.cobs import DELIMITER, Deframer, frame
from drivers.transport.wires import ByteLink, CanFrame, CanLink

NOTHING_ON_BUS = ": check its supply, the wires with a terminator at both ends, and that the bus runs at its bit rate"


class SkinPort(Protocol):
    """One wire with one board."""

    @property
    def link(self) -> Device:
        """The wire, or a file."""

    @property
    def is_started(self) -> bool:
        """True from the first scan until the next restart."""

    @property
    def changed(self) -> str:
        """Text that names the modules exchanged since the first discovery of the board; empty if none."""

    def forget(self) -> None:
        """Discard everything received."""

    def restart(self) -> None:
        """Begin the dialogue with the board again."""

    def exchange(self, now: float) -> list[RawScan]:
        """Send what is due, and return the received scans; never wait.

        Raises:
            CellError: The wire is lost.
        """

    def refused(self) -> int:
        """Return the number of messages that could not be decoded."""

    def trouble(self) -> str:
        """Return the reason why no scan arrives, derived from the received frames."""


class HubOnCan(CySkinDialogue):
    """A CySkin hub on a CAN bus."""

    def __init__(self, link: CanLink, config: HubConfig, period: float) -> None:
        """Describe the hub; `period` is the requested time between two scans, s."""
        self.link = link
        super().__init__(config, period)

    def forget(self) -> None:
        """Discard everything received."""
        super().forget()
        self._senders: defaultdict[int, CanAssembler] = defaultdict(CanAssembler)
        self._own = self._others = 0

    def exchange(self, now: float) -> list[RawScan]:
        """Take the received messages, send what is due, and return the completed scans."""
        scans, wire = list[RawScan](), self._config.wire
        for part in _waiting(self.link):
            hub = sender(part)
            data = None if hub is None else self._senders[hub].feed(part)
            is_own = hub == wire.hub
            self._own += is_own
            self._others += not is_own
            # A hub without a number answers the discovery under any id.
            if data is not None and (is_own or data[:1] == bytes([HubCommand.DISCOVER])):
                scans += self.take(data, now - part.waited)
        for item in self.ask(now):
            for part in [item] if isinstance(item, CanFrame) else to_can(encode(item, wire), ALL_HUBS):
                self.link.write(part)
        return scans

    def refused(self) -> int:
        """Return the number of messages that could not be decoded, and of frames out of sequence."""
        return self._senders[self._config.wire.hub].broken + super().refused()

    def trouble(self) -> str:
        """Return the reason why no scan arrives."""
        if self._others and not self.heard and not self._wrong:
            return f"{self._others} frames on the bus, none of a CySkin hub: another board on this bus?"
        return super().trouble() + ("" if self._own or self._others else NOTHING_ON_BUS)


class IcubOnCan:
    """An iCub skin board on a CAN bus.

    Scans of a board have no numbers: a triangle that arrives a second time begins the next scan.
    """

    changed = ""
    """Empty text: triangles of such a board have no serial numbers, so an exchange is not detectable."""

    def __init__(self, link: CanLink, config: IcubConfig) -> None:
        self.link, self._config = link, config
        self._row = {number: row for row, number in enumerate(config.triangles)}
        self._channels = np.array(config.channels)
        self.forget()

    def forget(self) -> None:
        """Discard everything received."""
        self._frames, self._has_heard = TriangleAssembler(self._config.board), False
        self.restart()

    def restart(self) -> None:
        """Start the board again."""
        self._next, self._stamp, self.is_started = -math.inf, 0.0, False
        self._begun: dict[int, TriangleReading] = {}

    def exchange(self, now: float) -> list[RawScan]:
        """Repeat the start message until the board sends, and return the completed scans."""
        if now >= self._next and not self.is_started:
            self._next = now + RETRY
            self.link.write(setup(self._config.board))
        scans = [self._take(part, now - part.waited) for part in _waiting(self.link)]
        return [scan for scan in scans if scan is not None]

    def _take(self, frame: CanFrame, stamp: float) -> RawScan | None:
        """Take a frame; return the scan that it completes."""
        triangle = self._frames.feed(frame)
        if triangle is None or triangle[0] not in self._row:
            return None
        self._has_heard = self.is_started = True
        number, reading = triangle
        if number in self._begun:
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
        return RawScan(counts.reshape(FINGERS, -1), np.full(BOARD_MODULES, np.nan), self._stamp, 0)

    def refused(self) -> int:
        """Return the number of frames of another protocol, and of frames without their other half."""
        return self._frames.broken

    def trouble(self) -> str:
        """Return what is still missing before scans arrive, in one line."""
        board = f"board {self._config.board}"
        if not self._has_heard:
            return f"{board} does not send{NOTHING_ON_BUS}"
        missing = ", ".join(str(n) for n in self._row if n not in self._begun) or "none"
        return f"{board} sends no whole scan; missing triangles: {missing}"


class HubOnSerial(CySkinDialogue):
    """A CySkin hub on a serial line.

    The framing of a hub's messages on a serial line is not public. This class sends each message as one frame of
    `drivers.transport.cobs`, and does not use the boot loader.
    """

    def __init__(self, link: ByteLink, config: HubConfig, period: float) -> None:
        """Describe the hub; `period` is the requested time between two scans, s."""
        self.link = link
        super().__init__(config, period)

    def forget(self) -> None:
        """Discard everything received."""
        super().forget()
        self._frames, self._whole = Deframer(LONGEST), 0

    def exchange(self, now: float) -> list[RawScan]:
        """Take the received messages, send what is due, and return the completed scans."""
        data = self.link.read(0.0)
        behind, scans = len(data), list[RawScan]()
        for piece in _pieces(data):
            # A frame's first byte is at least as old as the transfer time of all bytes from it to the end of `data`.
            stamp = now - behind * self.link.character_time
            behind -= len(piece)
            for content in self._frames.feed(piece):
                self._whole += 1
                scans += self.take(content, stamp)
        for item in self.ask(now):
            if isinstance(item, Message):
                self.link.write(frame(encode(item, self._config.wire)))
        return scans

    def refused(self) -> int:
        """Return the number of frames and messages that could not be decoded."""
        return self._frames.broken + super().refused()

    def trouble(self) -> str:
        """Return the reason why no scan arrives."""
        if self._frames.bytes and not self._whole:
            return f"{self._frames.bytes} bytes received, but no frame: check that skin.baud_rate is the board's"
        return super().trouble() + (
            "" if self._frames.bytes else ": check its supply and cable, whether this is its port, and skin.baud_rate"
        )


def _pieces(data: bytes) -> list[bytes]:
    """Return `data` split after every frame delimiter."""
    *whole, rest = data.split(bytes([DELIMITER]))
    return [piece + bytes([DELIMITER]) for piece in whole] + ([rest] if rest else [])


def _waiting(link: CanLink) -> list[CanFrame]:
    """Return the received frames."""
    frames: list[CanFrame] = []
    # Largest number of frames per read of a bus, so that a babbling node does not delay the scan.
    while len(frames) < 1000 and (part := link.read(0.0)) is not None:
        frames.append(part)
    return frames
