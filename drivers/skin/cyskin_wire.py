"""CySkin: messages of a hub <-> bytes <-> CAN frames; pure, no I/O.

A hub carries modules of up to 12 channels, name 0 the temperature and 1 to 11 the taxels. Commands, records and
ids are those of the public headers [cyskin_driver]; what these do not say is a key of `SkinWireConfig`, or one of
these assumptions, to be checked on the first real board: the sequence byte counts scans modulo 16 and stands in
front of all messages of one scan, the check sum covers it, DECLARE is answered with the number of modules and
then the number of channels of each, and a period is two bytes.
"""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel
from drivers.skin.health import Counts
from drivers.transport.crc import Byte, Crc8
from drivers.transport.wires import CanFrame

FIRST_COMMAND = 0x10
"""First number of commands; a first byte below it is a sequence number."""
LONGEST = 1 + 2 + 255 + 1
"""Length of the longest message, bytes."""
FIRST, MIDDLE, LAST = 0x100, 0x200, 0x400
"""Bits of a CAN id that tell which part of a message a frame is; a single frame is first and last."""
NUMBERED_WINDOWS = 8
"""Age in windows up to which equal sequence numbers mean the same scan, because numbers repeat after 16 scans."""
_PART, _HUB = 0x700, 0xFF
_FRAME_BYTES = 8
_DETAILS = struct.Struct("<BIBBHBB")


class HubCommand(IntEnum):
    """Number of what a message is about."""

    ERROR = 0x13
    AUTO_SYNC = 0x37
    PERIOD = 0x38
    DECLARE = 0x3C
    DETAILS = 0x3D
    SENSOR_DATA = 0x43


class WireError(ValueError):
    """The bytes are not a message, or the message does not fit the board."""


class SkinWireConfig(ConfigModel):
    """Parts of the protocol that differ between firmwares.

    Source: assumed.
    """

    hub: Byte = 1
    """Number of the hub, the low byte of its CAN ids. Source: set for each cell."""
    byte_order: Literal["little", "big"] = "little"
    """Byte order of readings and of the period; modules' records are little-endian in all public firmwares. Source:
    assumed; [cyskin_driver] for modules' records.
    """
    crc: Crc8 = Crc8()
    """Check sum of the messages; the polynomial is not public."""
    values_per_message: Annotated[int, Field(ge=1, le=126)] = 24
    """Number of readings that one message carries at most; 24 is two modules, in seven CAN frames."""


@dataclass(frozen=True, slots=True)
class Message:
    """One message between hub and host."""

    command: int
    payload: bytes = b""
    sequence: int | None = None
    """Sequence number, 0 to 15; None for a message without one."""


@dataclass(frozen=True, slots=True)
class Module:
    """What a hub reports of one module."""

    number: int
    """Number of the module on this hub."""
    sui: int
    """Number that is burnt into the module (sui); a channel's uid is sui << 4 | name."""
    channels: int
    """Number of channels of the module, cut ones included."""
    group: int = 0
    uncut: int = 0x0FFF
    """Mask with one bit for each channel, by name, that is not cut."""
    control: int = 0
    speed: int = 0

    @property
    def names(self) -> tuple[int, ...]:
        """Names of the channels whose readings the hub sends, in that order."""
        return tuple(name for name in range(min(self.channels, 16)) if self.uncut >> name & 1)


def encode(message: Message, wire: SkinWireConfig) -> bytes:
    """Return a message as bytes.

    Raises:
        WireError: The payload is too long, or command or sequence out of range.
    """
    command, payload, sequence = message.command, message.payload, message.sequence
    if not FIRST_COMMAND <= command <= 0xFF or len(payload) > 0xFF or not 0 <= (sequence or 0) < FIRST_COMMAND:
        raise WireError(
            f"command {command}, sequence {sequence}, {len(payload)} bytes: 16 to 255, 0 to 15, 255 allowed"
        )
    head = b"" if sequence is None else bytes([sequence])
    body = head + bytes([command, len(payload)]) + payload
    return body + bytes([wire.crc.of(body)])


def decode(data: bytes, wire: SkinWireConfig) -> Message:
    """Return the message that the whole of `data` is.

    Raises:
        WireError: The length or the check sum does not fit.
    """
    start = 1 if data and data[0] < FIRST_COMMAND else 0
    if len(data) < start + 3 or len(data) != start + 3 + data[start + 1] or data[start] < FIRST_COMMAND:
        raise WireError(f"{len(data)} bytes are no message")
    if wire.crc.of(data[:-1]) != data[-1]:
        raise WireError("check sum does not fit")
    return Message(data[start], data[start + 2 : -1], data[0] if start else None)


def to_can(message: bytes, hub: int) -> list[CanFrame]:
    """Return the frames that carry a message."""
    parts = [message[at : at + _FRAME_BYTES] for at in range(0, len(message), _FRAME_BYTES)]
    if len(parts) == 1:
        return [CanFrame(FIRST | LAST | hub, parts[0])]
    kinds = [FIRST, *[MIDDLE] * (len(parts) - 2), LAST]
    return [CanFrame(kind | hub, part) for kind, part in zip(kinds, parts, strict=True)]


class CanAssembler:
    """Joins CAN frames of one hub to whole messages, still as bytes.

    Args:
        hub: Number of the hub to listen to.
    """

    def __init__(self, hub: int) -> None:
        self._hub = hub
        self._pending: bytearray | None = None
        self.frames = 0
        """Number of frames of this hub."""
        self.broken = 0
        """Number of frames out of turn, and of messages that began and never ended."""

    def feed(self, frame: CanFrame) -> bytes | None:
        """Take one frame; return the message that it ends."""
        if frame.id & ~_PART != self._hub:
            return None
        self.frames += 1
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

    def reset(self) -> None:
        """Discard a message that has begun."""
        self._pending = None


def encode_module(module: Module) -> bytes:
    """Return a module's record, the payload of an answer to DETAILS."""
    return _DETAILS.pack(
        module.number, module.sui, module.channels, module.group, module.uncut, module.control, module.speed
    )


def decode_module(payload: bytes) -> Module:
    """Return the module that a record describes.

    Raises:
        WireError: The record has another length, or says that the module has no channel.
    """
    if len(payload) != _DETAILS.size:
        raise WireError(f"record of a module: {len(payload)} bytes, {_DETAILS.size} allowed")
    module = Module(*_DETAILS.unpack(payload))
    if not module.names:
        raise WireError(f"record of module {module.number}: no channel")
    return module


def encode_period(period: float, wire: SkinWireConfig) -> bytes:
    """Return the payload that sets the time between two scans, given in s."""
    return round(period * 1e3).to_bytes(2, wire.byte_order)


def decode_period(payload: bytes, wire: SkinWireConfig) -> float:
    """Return the period that a payload sets, s.

    Raises:
        WireError: The payload is not two bytes long, or the period is zero.
    """
    if len(payload) != 2 or not any(payload):
        raise WireError(f"period: {payload.hex() or 'nothing'}, 1 to 65535 ms allowed")
    return int.from_bytes(payload, wire.byte_order) * 1e-3


class Channels:
    """The channels of a hub's modules in the order in which their readings are sent, one module after the other."""

    def __init__(self, modules: Sequence[Module]) -> None:
        """Take the modules of a hub."""
        ordered = sorted(modules, key=lambda module: module.number)
        self.modules = tuple(ordered)
        self.uid = tuple(module.sui << 4 | name for module in ordered for name in module.names)
        """Numbers of the channels (uid), in the order of their readings."""
        self._places = [(module.number, name) for module in ordered for name in module.names]
        self._index = {place: number for number, place in enumerate(self._places)}

    def __len__(self) -> int:
        """Return the number of readings in one scan."""
        return len(self._places)

    def encode(self, readings: Counts, wire: SkinWireConfig, sequence: int | None) -> list[Message]:
        """Return the messages that carry one scan, all channels' readings, counts."""
        words = np.asarray(readings).astype("<u2" if wire.byte_order == "little" else ">u2")
        most = wire.values_per_message
        return [
            Message(HubCommand.SENSOR_DATA, bytes(self._places[at]) + words[at : at + most].tobytes(), sequence)
            for at in range(0, len(words), most)
        ]

    def decode(self, payload: bytes, wire: SkinWireConfig) -> tuple[int, Counts]:
        """Return the first channel of a message with sensor data, and the readings from there on, counts.

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
    """Joins parts of scans to whole ones, and never parts of two scans.

    Args:
        length: Number of readings in a whole scan.
        window: Time between arrivals beyond which parts are not of one scan, s; numbered parts may be a little later.
    """

    def __init__(self, length: int, window: float) -> None:
        self._window = window
        self._readings: Counts = np.zeros(length, dtype=np.uint16)
        self._there = np.zeros(length, dtype=bool)
        self._sequence: int | None = None
        self._begun = -math.inf
        self._last: int | None = None
        self.incomplete = 0
        """Number of scans of which a part never came."""
        self.lost = 0
        """Number of scans missing between whole ones, by their sequence numbers, modulo 16."""

    def add(self, part: tuple[int, Counts], sequence: int | None, stamp: float) -> tuple[Counts, float] | None:
        """Take a part of a scan; return the scan that it completes, with the time at which its first part came.

        Args:
            part: First channel of the part, and the readings from there on.
            sequence: Sequence number of the message that brought it.
            stamp: Time of arrival, s.
        """
        start, readings = part
        where = slice(start, start + len(readings))
        # Parts come in order, so that one that starts before the parts present belongs to the next scan.
        window = self._window if sequence is None else NUMBERED_WINDOWS * self._window
        if sequence != self._sequence or self._there[start:].any() or stamp - self._begun > window:
            self.incomplete += bool(self._there.any())
            self._there[:] = False
            self._sequence, self._begun = sequence, stamp
        self._readings[where], self._there[where] = readings, True
        if not self._there.all():
            return None
        begun = self._begun
        self._there[:], self._begun = False, -math.inf
        if sequence is not None:
            if self._last is not None:
                self.lost += (sequence - self._last - 1) % FIRST_COMMAND
            self._last = sequence
        return self._readings.copy(), begun

    def reset(self) -> None:
        """Discard a scan that has begun, and forget the last one's number."""
        self._there[:] = False
        self._last = None
