"""One wire with one skin board: it receives raw scans and sends the dialogue's messages."""

from collections import defaultdict
from typing import Protocol

from drivers.protocols import Device
from drivers.skin.board_config import HubConfig, IcubConfig
from drivers.skin.cyskin_wire import (
    ALL_HUBS,
    LONGEST,
    CanAssembler,
    HubCommand,
    Message,
    WireError,
    decode,
    encode,
    sender,
    to_can,
)
from drivers.skin.dialogue import CySkinDialogue, IcubDialogue, RawScan
from drivers.transport.cobs import DELIMITER, Deframer, frame
from drivers.transport.wires import ByteLink, CanFrame, CanLink

NOTHING_ON_BUS = ": check its supply, the wires with a terminator at both ends, and that the bus runs at its bit rate"


class Dialogue(Protocol):
    """State of the dialogue with a board."""

    @property
    def is_started(self) -> bool:
        """True from the first scan until the next restart."""

    @property
    def changed(self) -> str:
        """Text that names the exchanges since the board was first discovered; empty if there are none."""

    def restart(self) -> None:
        """Begin the dialogue again."""


class SkinPort(Protocol):
    """One wire with one board."""

    @property
    def link(self) -> Device:
        """The wire, or a file."""

    @property
    def dialogue(self) -> Dialogue:
        """The dialogue with the board."""

    def forget(self) -> None:
        """Discard everything received."""

    def exchange(self, now: float) -> list[RawScan]:
        """Send what is due, and return the received scans; never wait.

        Raises:
            CellError: The wire is lost.
        """

    def refused(self) -> int:
        """Number of messages that could not be decoded."""

    def trouble(self) -> str:
        """Return the reason why no scan arrives, derived from the received frames."""


class _Hub:
    """Common parts of a CySkin hub on every wire."""

    def __init__(self, config: HubConfig, period: float) -> None:
        """Describe the hub; `period` is the requested time between two scans, s."""
        self._wire, self.dialogue = config.wire, CySkinDialogue(config, period)
        self.forget()

    def forget(self) -> None:
        """Discard everything received."""
        self.dialogue.forget()
        self._wrong = 0

    def _take(self, data: bytes, stamp: float) -> list[RawScan]:
        """Return the scan that a message completes, if any; count a message that cannot be decoded."""
        try:
            scan = self.dialogue.take(decode(data, self._wire), stamp)
        except WireError:
            self._wrong += 1
            return []
        return [] if scan is None else [scan]

    def _wrong_sums(self) -> str:
        """Return the text for a line or bus with more wrong check sums than messages; empty if there are fewer."""
        if self._wrong <= (heard := self.dialogue.heard):
            return ""
        return f"{self._wrong} of {self._wrong + heard} messages have a wrong check sum: see board.wire.crc"


class HubOnCan(_Hub):
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
        """Return the received scans, then send what is due."""
        scans = list[RawScan]()
        for part in _waiting(self.link):
            hub = sender(part)
            data = None if hub is None else self._senders[hub].feed(part)
            is_own = hub == self._wire.hub
            self._own += is_own
            self._others += not is_own
            # A hub without a number answers the discovery under any id.
            if data is not None and (is_own or data[:1] == bytes([HubCommand.DISCOVER])):
                scans += self._take(data, now - part.waited)
        for item in self.dialogue.ask(now):
            for part in [item] if isinstance(item, CanFrame) else to_can(encode(item, self._wire), ALL_HUBS):
                self.link.write(part)
        return scans

    def refused(self) -> int:
        """Number of messages that could not be decoded, and of frames out of sequence."""
        return self._senders[self._wire.hub].broken + self._wrong + self.dialogue.refused

    def trouble(self) -> str:
        """Return the reason why no scan arrives."""
        if wrong := self._wrong_sums():
            return wrong
        if not self.dialogue.heard and self._others:
            return f"{self._others} frames on the bus, none of a CySkin hub: another board on this bus?"
        return self.dialogue.trouble() + ("" if self._own or self._others else NOTHING_ON_BUS)


class IcubOnCan:
    """An iCub skin board on a CAN bus."""

    def __init__(self, link: CanLink, config: IcubConfig) -> None:
        """Describe the board."""
        self.link, self.dialogue = link, IcubDialogue(config)
        self.forget()

    def forget(self) -> None:
        """Discard everything received."""
        self.dialogue.forget()

    def exchange(self, now: float) -> list[RawScan]:
        """Send what is due, and return the received scans."""
        for part in self.dialogue.ask(now):
            self.link.write(part)
        scans = [self.dialogue.take(part, now - part.waited) for part in _waiting(self.link)]
        return [scan for scan in scans if scan is not None]

    def refused(self) -> int:
        """Number of frames that could not be decoded."""
        return self.dialogue.refused

    def trouble(self) -> str:
        """Return the reason why no scan arrives."""
        return self.dialogue.trouble() + ("" if self.dialogue.heard else NOTHING_ON_BUS)


class HubOnSerial(_Hub):
    """A CySkin hub on a serial line.

    The framing of its messages there is not public. Here each message is one frame of `drivers.transport.cobs`, and the
    boot loader is not used.
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
        """Return the received scans, then send what is due."""
        data = self.link.read(0.0)
        behind, scans = len(data), list[RawScan]()
        for piece in _pieces(data):
            # A frame's first byte arrived at least the transfer time of the frame and of all later bytes ago.
            stamp = now - behind * self.link.character_time
            behind -= len(piece)
            for content in self._frames.feed(piece):
                self._whole += 1
                scans += self._take(content, stamp)
        for item in self.dialogue.ask(now):
            if isinstance(item, Message):
                self.link.write(frame(encode(item, self._wire)))
        return scans

    def refused(self) -> int:
        """Number of frames and messages that could not be decoded."""
        return self._frames.broken + self._wrong + self.dialogue.refused

    def trouble(self) -> str:
        """Return the reason why no scan arrives."""
        if self._frames.bytes and not self._whole:
            return f"{self._frames.bytes} bytes heard and no frame among them: another baud rate than skin.baud_rate?"
        return self._wrong_sums() or self.dialogue.trouble() + (
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
