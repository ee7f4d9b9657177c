"""CySkin: messages of a hub <-> bytes <-> CAN frames; pure, no I/O.

A hub connects modules of up to 12 channels: name 0 is the temperature, 1 to 11 are the taxels. Commands, records and ids
are those of the public headers [cyskin_driver]. Byte order, check sum and start-up messages were observed by connecting
the makers' library [cyskin] to a bus that answers it; the tests contain these messages.
"""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from drivers.config_model import ConfigModel, Source
from drivers.skin.health import Counts
from drivers.transport.crc import Crc8
from drivers.transport.wires import CanFrame

FIRST_COMMAND = 0x10
"""First number of commands."""
LONGEST = 2 + 255 + 1
"""Length of the longest message, bytes."""
FIRST, MIDDLE, LAST = 0x100, 0x200, 0x400
"""Bits of a CAN id that mark the frame's part of a message; the frame of a one-frame message is first and last."""
ALL_HUBS = 0xFF
"""Number that addresses all hubs, including those without a number."""
ALL_MODULES = 0xFF
"""Number that addresses all modules of a hub."""
LEAVE_BOOT_LOADER = CanFrame(0x17FFFFFF, bytes.fromhex("013B00004F6D17"), is_extended=True)
"""Frame that makes all hubs leave their boot loaders; its check sum is a CRC of 16 bits."""
CHANNELS = 12
"""Largest number of channels of a module."""
_PART, _HUB = 0x700, 0xFF
_FRAME_BYTES = 8
_DETAILS, _DETAILS_IN_BOOT_LOADER = "BIBxHxx", "BI"
"""Formats of a module's records; group, control and speed in its details are not used."""


class HubCommand(IntEnum):
    """Number of a message's subject."""

    DISCOVER = 0x10
    SET_NUMBER = 0x11
    ERROR = 0x13
    LEAVE_MODULES_BOOT_LOADERS = 0x31
    AUTO_SYNC = 0x37
    PERIOD = 0x38
    DECLARE = 0x3C
    DETAILS = 0x3D
    SENSOR_DATA = 0x43


Step = Literal[
    "leave_boot_loader", "discover", "set_number", "declare", "details", "stop", "leave_modules_boot_loaders", "start"
]
"""Step of the start-up of a hub."""
_STRUCTURE: tuple[Step, ...] = ("discover", "set_number", "declare", "details")
MAKERS_START_UP: tuple[Step, ...] = (
    "leave_boot_loader",
    *_STRUCTURE,
    "stop",
    "leave_modules_boot_loaders",
    *_STRUCTURE,
    "start",
)
"""Order in which the makers' host program brings a hub from power-on to sensor data. Source: [cyskin]."""


class WireError(ValueError):
    """The bytes are not a message, or the message does not fit the board."""


class SkinWireConfig(ConfigModel):
    """Dialect of a hub's firmware; the default is that of the makers' library."""

    SOURCE: ClassVar[str] = "[cyskin]"

    hub: Annotated[int, Field(ge=1, le=0xFE), Source("set for each cell")] = 1
    """Number given to the hub, the low byte of its CAN ids."""
    byte_order: Literal["little", "big"] = "big"
    """Byte order of all numbers."""
    crc: Crc8 = Crc8()
    """Check sum of the messages."""
    start_up: Annotated[tuple[Step, ...], Field(min_length=1)] = MAKERS_START_UP
    """Steps of the start-up in their order; only CAN has the step that leaves the boot loader."""

    @field_validator("start_up")
    @classmethod
    def _ends_with_start(cls, start_up: tuple[Step, ...]) -> tuple[Step, ...]:
        if start_up[-1] != "start":
            raise ValueError(f'ends with "{start_up[-1]}"; "start" needed as the last step')
        return start_up


@dataclass(frozen=True, slots=True)
class Message:
    """One message between hub and host."""

    command: int
    payload: bytes = b""


@dataclass(frozen=True, slots=True)
class Module:
    """A hub's record of one module."""

    number: int
    """Number of the module on this hub."""
    sui: int
    """Number stored in the module by its maker (sui); a channel's uid is sui << 4 | name."""
    channels: int = 0
    """Number of channels of the module, including cut ones; 0 if the module is still in its boot loader."""
    uncut: int = 0x0FFF
    """Mask with one bit for each channel, by name; 1 if the channel is not cut."""

    @property
    def names(self) -> tuple[int, ...]:
        """Names of the channels whose readings the hub sends, in that order."""
        return tuple(name for name in range(self.channels) if self.uncut >> name & 1)


def encode(message: Message, wire: SkinWireConfig) -> bytes:
    """Return a message as bytes.

    Raises:
        WireError: The payload is too long, or the command out of range.
    """
    command, payload = message.command, message.payload
    if not FIRST_COMMAND <= command <= 0xFF or len(payload) > 0xFF:
        raise WireError(f"command {command}, {len(payload)} bytes: 16 to 255, 255 allowed")
    body = bytes([command, len(payload)]) + payload
    return body + bytes([wire.crc.of(body)])


def decode(data: bytes, wire: SkinWireConfig) -> Message:
    """Return the message in `data`, which must hold exactly one.

    Raises:
        WireError: The length or the check sum is wrong.
    """
    if len(data) < 3 or len(data) != 3 + data[1] or data[0] < FIRST_COMMAND:
        raise WireError(f"{len(data)} bytes are no message")
    if wire.crc.of(data[:-1]) != data[-1]:
        raise WireError("check sum does not fit")
    return Message(data[0], data[2:-1])


def to_can(message: bytes, hub: int) -> list[CanFrame]:
    """Return the frames that carry a message."""
    parts = [message[at : at + _FRAME_BYTES] for at in range(0, len(message), _FRAME_BYTES)]
    if len(parts) == 1:
        return [CanFrame(FIRST | LAST | hub, parts[0])]
    kinds = [FIRST, *[MIDDLE] * (len(parts) - 2), LAST]
    return [CanFrame(kind | hub, part) for kind, part in zip(kinds, parts, strict=True)]


class CanAssembler:
    """Joins the CAN frames of one sender to whole messages, still as bytes."""

    def __init__(self) -> None:
        self._pending: bytearray | None = None
        self.broken = 0
        """Number of frames out of sequence, and of messages without an end."""

    def feed(self, frame: CanFrame) -> bytes | None:
        """Take one frame; return the message that it completes."""
        part, pending = frame.id & _PART, self._pending
        if part in (FIRST, FIRST | LAST):
            self.broken += pending is not None
            self._pending = bytearray(frame.data) if part == FIRST else None
            return bytes(frame.data) if part != FIRST else None
        if pending is None or part not in (MIDDLE, LAST) or len(pending) + len(frame.data) > LONGEST:
            self.broken += 1
            self._pending = None
            return None
        pending += frame.data
        if part == MIDDLE:
            return None
        self._pending = None
        return bytes(pending)


def sender(frame: CanFrame) -> int | None:
    """Return the number of the sending or addressed hub of a frame; None if the frame is of another protocol."""
    return None if frame.is_extended else frame.id & _HUB


def decode_module(payload: bytes, wire: SkinWireConfig) -> Module:
    """Return the module that a record describes; a module in its boot loader reports no channels.

    Raises:
        WireError: The record has another length, or names channels that no module has.
    """
    order = "<" if wire.byte_order == "little" else ">"
    lengths = [struct.calcsize(order + layout) for layout in (_DETAILS_IN_BOOT_LOADER, _DETAILS)]
    if len(payload) not in lengths:
        raise WireError(f"record of a module: {len(payload)} bytes, {lengths[0]} or {lengths[1]} allowed")
    if len(payload) == lengths[0]:
        return Module(*struct.unpack(order + _DETAILS_IN_BOOT_LOADER, payload))
    module = Module(*struct.unpack(order + _DETAILS, payload))
    if not module.names or module.channels > CHANNELS or module.uncut >> CHANNELS:
        raise WireError(
            f"record of module {module.number}: {module.channels} channels, mask 0x{module.uncut:04X}; "
            f"1 to {CHANNELS} channels allowed: see board.wire.byte_order"
        )
    return module


def encode_period(period: float, wire: SkinWireConfig) -> bytes:
    """Return the payload that sets the time between two scans to `period`, s."""
    return round(period * 1e3).to_bytes(2, wire.byte_order)


class Channels:
    """The channels of a hub's modules in the order of their readings, one module after the other."""

    def __init__(self, modules: Sequence[Module]) -> None:
        ordered = sorted(modules, key=lambda module: module.number)
        self.modules = tuple(ordered)
        self.uid = tuple(module.sui << 4 | name for module in ordered for name in module.names)
        """Numbers of the channels (uid), in the order of their readings."""
        places = [(module.number, place) for module in ordered for place in range(len(module.names))]
        self._index = {place: number for number, place in enumerate(places)}

    def __len__(self) -> int:
        """Return the number of readings in one scan."""
        return len(self.uid)

    def decode(self, payload: bytes, wire: SkinWireConfig) -> tuple[int, Counts]:
        """Return the first channel of a message with sensor data, and the readings from there on, counts.

        The message begins with the number of a module, and the index of a channel among those that the module sends.

        Raises:
            WireError: The message does not fit these modules.
        """
        if len(payload) < 4 or len(payload) % 2:
            raise WireError(f"sensor data of {len(payload)} bytes: 4 or more, an even number, allowed")
        start = self._index.get((payload[0], payload[1]))
        count = len(payload) // 2 - 1
        if start is None or start + count > len(self):
            raise WireError(f"sensor data: {count} readings from module {payload[0]}, channel {payload[1]} on")
        words = np.frombuffer(payload, "<u2" if wire.byte_order == "little" else ">u2", offset=2)
        return start, words.astype(np.uint16)


class ScanAssembler:
    """Joins parts of scans to whole ones.

    Scans have no numbers; parts arrive in order and close together. Parts of two scans could be joined only if both arrive
    within one window and each scan lost the parts that the other one has.

    Args:
        length: Number of readings in a whole scan.
        window: Time between arrivals above which parts belong to different scans, s.
    """

    def __init__(self, length: int, window: float) -> None:
        self._window = window
        self._readings: Counts = np.zeros(length, dtype=np.uint16)
        self._there = np.zeros(length, dtype=bool)
        self._begun = -math.inf
        self.incomplete = 0
        """Number of scans with a missing part."""

    def add(self, part: tuple[int, Counts], stamp: float) -> tuple[Counts, float] | None:
        """Take a part of a scan; return the scan that it completes, with the arrival time of its first part.

        Args:
            part: First channel of the part, and the readings from there on.
            stamp: Time of arrival, s.
        """
        start, readings = part
        where = slice(start, start + len(readings))
        # Parts arrive in order: if a part starts before the present ones, it belongs to the next scan.
        if self._there[start:].any() or stamp - self._begun > self._window:
            self.incomplete += bool(self._there.any())
            self._there[:] = False
            self._begun = stamp
        self._readings[where], self._there[where] = readings, True
        if not self._there.all():
            return None
        begun = self._begun
        self._there[:], self._begun = False, -math.inf
        return self._readings.copy(), begun
