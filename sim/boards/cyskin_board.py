"""An emulated CySkin hub with the answers of the makers' firmware to the makers' host program.

The bytes of the hub follow messages recorded with the makers' library [cyskin]. This module shares no code with the
driver, so that one error cannot be in both. The hub sends only the answers that the host program needs; it does not
acknowledge a new number or period.
"""

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from drivers.skin.board_config import BOARD_MODULES, TEMPERATURE, HubConfig
from drivers.skin.health import Counts
from drivers.transport.cobs import Deframer, frame
from drivers.transport.wires import CanFrame

TEMPERATURE_COUNTS = 21_000
"""Reading of a module's temperature channel, counts; its last digit is the module's number."""
READINGS = 24
"""Number of readings in one message; 24 readings are two modules, in seven CAN frames."""
BOOT_LOADER_EXIT = (0x17FFFFFF, bytes.fromhex("013B00004F6D17"))
EVERYBODY = 0xFF
UNSUPPORTED, INVALID = 0xE2, 0xE3


class EmulatedHub:
    """The hub behind its wire: messages in, messages out."""

    def __init__(self, config: HubConfig, measure: Callable[[], Counts]) -> None:
        """Build a hub with the modules of `config` and taxel readings from `measure`."""
        first_sui = 3500  # Own number (sui) of the first module of an emulated hub if the config names no modules.
        self._taxels = config.channels
        self._channels = sorted((TEMPERATURE, *self._taxels))
        self.measure = measure
        self.replace_modules(config.modules or range(first_sui, first_sui + BOARD_MODULES))

    def replace_modules(self, suis: Sequence[int]) -> None:
        """Put modules with these own numbers (sui) on the hub and restart it; at most four, left finger first."""
        self.suis = suis
        self.power(0.0)

    def power(self, at: float) -> None:
        """Restart the hub: hub and modules are in their boot loaders, and the hub has no number."""
        self.is_in_boot_loader = self.are_modules_in_boot_loaders = True
        self.number: int | None = None
        # Default scan period of a hub, s.
        self.next_scan, self._period = math.inf, 0.05

    def take(self, message: bytes, at: float) -> list[bytes]:
        """Process a whole message of the host; return the answers."""
        uid = bytes.fromhex("12345678")  # Unique number of the hub.
        if self.is_in_boot_loader or len(message) < 3 or len(message) != 3 + message[1] or check_sum(message):
            return []
        command, payload = message[0], message[2:-1]
        if command == 0x10:
            return [sealed(0x10, uid)]
        if command == 0x11:
            if payload[:4] == uid:
                self.number = payload[4]
            return []
        return [] if self.number is None else self._answers(command, payload, at)

    def _answers(self, command: int, payload: bytes, at: float) -> list[bytes]:
        """Return the answers of a hub that has received its number."""
        if command == 0x31:
            self.are_modules_in_boot_loaders = False
            return []
        if command == 0x37:
            self.next_scan = at + self._period if any(payload) else math.inf
            return []
        if command == 0x38:
            period = int.from_bytes(payload, "big")
            if len(payload) != 2 or not period:
                return [sealed(0x13, bytes([command, INVALID]))]
            self._period = period / 1000.0
            return []
        if command == 0x3C:
            return [sealed(0x3C, self._structure())]
        if command == 0x3D:
            return [sealed(0x3D, self._details(number)) for number in self._asked(payload)]
        return [sealed(0x13, bytes([command, UNSUPPORTED]))]

    def _asked(self, payload: bytes) -> list[int]:
        known = range(len(self.suis))
        return list(known) if payload == bytes([EVERYBODY]) else [number for number in payload if number in known]

    def _structure(self) -> bytes:
        modules = len(self.suis)
        started = [] if self.are_modules_in_boot_loaders else [0, *[len(self._channels)] * modules]
        return bytes([modules, *started])

    def _details(self, number: int) -> bytes:
        record = bytes([number]) + self.suis[number].to_bytes(4, "big")
        if self.are_modules_in_boot_loaders:
            return record
        mask = sum(1 << name for name in self._channels)
        return record + bytes([12, 0]) + mask.to_bytes(2, "big") + bytes([0, 0])

    def scan(self) -> list[bytes]:
        """Measure; return the messages of the scan.

        Modules in their boot loaders return no readings.
        """
        self.next_scan += self._period
        if self.are_modules_in_boot_loaders:
            return []
        taxels = iter(self.measure().ravel().tolist())
        channels: list[tuple[int, int, int]] = []
        for number in range(len(self.suis)):
            reading = dict(zip(self._taxels, taxels, strict=False)) | {TEMPERATURE: TEMPERATURE_COUNTS + number}
            channels += [(number, place, reading[name]) for place, name in enumerate(self._channels)]
        messages = []
        for at in range(0, len(channels), READINGS):
            part = channels[at : at + READINGS]
            words = np.array([counts for _, _, counts in part], dtype=">u2").tobytes()
            messages.append(sealed(0x43, bytes(part[0][:2]) + words))
        return messages


class _HubBoard:
    """A hub on a wire."""

    def __init__(self, hub: EmulatedHub) -> None:
        self.hub = hub
        self.power(0.0)

    @property
    def next_scan(self) -> float:
        """Time of the hub's next measurement, s."""
        return self.hub.next_scan

    def power(self, at: float) -> None:
        """Restart the hub."""
        self.hub.power(at)


class CanBoard(_HubBoard):
    """A hub on a CAN bus."""

    def power(self, at: float) -> None:
        """Restart the hub."""
        super().power(at)
        self._begun = b""

    def take(self, item: CanFrame, at: float) -> list[CanFrame]:
        """Process a frame; return the answer if it completes a message."""
        if item.is_extended:
            if (item.id, item.data) == BOOT_LOADER_EXIT:
                self.hub.is_in_boot_loader = False
            return []
        part, number = item.id & 0x700, item.id & 0xFF
        if number not in (EVERYBODY, self.hub.number):
            return []
        self._begun = (b"" if part & 0x100 else self._begun) + item.data
        return self._framed(self.hub.take(self._begun, at)) if part & 0x400 else []

    def scan(self) -> list[CanFrame]:
        """Measure; return the frames of the scan."""
        return self._framed(self.hub.scan())

    def _framed(self, messages: Iterable[bytes]) -> list[CanFrame]:
        number = EVERYBODY if self.hub.number is None else self.hub.number
        frames = []
        for message in messages:
            for at in range(0, len(message), 8):
                part = (0x100 if at == 0 else 0) | (0x400 if at + 8 >= len(message) else 0)
                frames.append(CanFrame((part or 0x200) | number, message[at : at + 8]))
        return frames


class SerialBoard(_HubBoard):
    """A hub on a serial line; there it has no boot loader."""

    def power(self, at: float) -> None:
        """Restart the hub."""
        super().power(at)
        self.hub.is_in_boot_loader = False
        self._frames = Deframer(2 + 255 + 1)

    def take(self, item: int, at: float) -> list[int]:
        """Process a byte; return the answer if it completes a message."""
        return self._framed(m for content in self._frames.feed(bytes([item])) for m in self.hub.take(content, at))

    def scan(self) -> list[int]:
        """Measure; return the bytes of the scan."""
        return self._framed(self.hub.scan())

    def _framed(self, messages: Iterable[bytes]) -> list[int]:
        return [byte for message in messages for byte in frame(message)]


def sealed(command: int, payload: bytes) -> bytes:
    """Return a message with its checksum."""
    body = bytes([command, len(payload)]) + payload
    return body + bytes([check_sum(body)])


def check_sum(data: bytes) -> int:
    """Return the checksum of `data`: the remainder of the division by x^8 + x^2 + x + 1, initial value 0xFF.

    With a correct checksum appended to the data, the result is 0.
    """
    rest = 0xFF
    for byte in data:
        rest ^= byte
        for _ in range(8):
            rest = (rest << 1 ^ 0x107) if rest & 0x80 else rest << 1
    return rest
