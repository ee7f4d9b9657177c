"""The SDO server of CANopen, expedited and segmented (CiA 301, 7.2.4.3): pure, one request in, one response out.

canopen's own server is not used: it accepts unannounced segments, continues after an abort, answers frames of any
length and never bounds its buffer (version 2.4.1). Block transfer is refused, as CiA 301 permits.
"""

import struct
from dataclasses import dataclass

from canopen import SdoAbortedError

from plc_bridge.canopen.object_values import Values

TOGGLE, COMMAND, LENGTH, TOO_LONG = 0x05030000, 0x05040001, 0x06070010, 0x06070012
ABORT = 0x80
"""First byte of an abort."""
SEGMENT_TIMEOUT = 5.0
"""Longest pause of the client within a transfer, s; the server then drops the transfer."""
_HEAD = struct.Struct("<BHB4s")
_ABORT = struct.Struct("<BHBL")
_TOGGLE_BIT, _LAST_BIT = 0x10, 0x01


@dataclass(slots=True)
class _Transfer:
    """A transfer in segments."""

    index: int
    subindex: int
    is_download: bool
    stamp: float
    room: int = 0
    size: int | None = None
    """Size that the client announced, bytes; None if it announced none."""
    data: bytes = b""
    """Received data, or data not sent yet."""
    toggle: int = 0


class SdoServer:
    """The default SDO server of one node; it has one client at a time."""

    def __init__(self, objects: Values) -> None:
        self._objects = objects
        self._transfer: _Transfer | None = None

    def reset(self) -> None:
        """Drop the transfer under way."""
        self._transfer = None

    def answer(self, request: bytes, now: float) -> bytes | None:
        """Return the response to a request of 8 bytes; None if the request is the client's abort.

        Args:
            request: Payload of the frame.
            now: Monotonic time, s.
        """
        command, index, subindex, _ = _HEAD.unpack(request)
        specifier, transfer = command >> 5, self._transfer
        if transfer is not None and now - transfer.stamp > SEGMENT_TIMEOUT:
            self._transfer = None
        if specifier == 4:
            self._transfer = None
            return None
        if specifier in (0, 3):
            index, subindex = (transfer.index, transfer.subindex) if transfer is not None else (0, 0)
        try:
            return self._serve(specifier, request, now)
        except SdoAbortedError as error:
            self._transfer = None
            return _ABORT.pack(ABORT, index, subindex, error.code)

    def _serve(self, specifier: int, request: bytes, now: float) -> bytes:
        command, index, subindex, data = _HEAD.unpack(request)
        match specifier:
            case 0:
                return self._take_segment(command, request[1:], now)
            case 1:
                return self._start_download(command, index, subindex, data, now)
            case 2:
                return self._start_upload(index, subindex, now)
            case 3:
                return self._give_segment(command, now)
        raise SdoAbortedError(COMMAND)

    def _start_download(self, command: int, index: int, subindex: int, data: bytes, now: float) -> bytes:
        self._transfer = None
        room = self._objects.room(index, subindex)
        is_expedited, is_sized = command & 2, command & 1
        if is_expedited:
            size = 4 - (command >> 2 & 3) if is_sized else min(room, 4)
            if size > room:
                raise SdoAbortedError(TOO_LONG)
            self._objects.write(index, subindex, data[:size])
        else:
            announced = int.from_bytes(data, "little") if is_sized else None
            if announced is not None and announced > room:
                raise SdoAbortedError(TOO_LONG)
            self._transfer = _Transfer(index, subindex, True, now, room, announced)
        return _HEAD.pack(0x60, index, subindex, b"")

    def _take_segment(self, command: int, data: bytes, now: float) -> bytes:
        transfer = self._continue(command, is_download=True, now=now)
        transfer.data += data[: 7 - (command >> 1 & 7)]
        if len(transfer.data) > transfer.room:
            raise SdoAbortedError(TOO_LONG)
        if command & _LAST_BIT:
            self._transfer = None
            if transfer.size not in (None, len(transfer.data)):
                raise SdoAbortedError(LENGTH)
            self._objects.write(transfer.index, transfer.subindex, transfer.data)
        return bytes([0x20 | command & _TOGGLE_BIT]) + bytes(7)

    def _start_upload(self, index: int, subindex: int, now: float) -> bytes:
        self._transfer = None
        data = self._objects.read(index, subindex)
        if 0 < len(data) <= 4:
            return _HEAD.pack(0x43 | 4 - len(data) << 2, index, subindex, data)
        self._transfer = _Transfer(index, subindex, False, now, data=data)
        return _HEAD.pack(0x41, index, subindex, len(data).to_bytes(4, "little"))

    def _give_segment(self, command: int, now: float) -> bytes:
        transfer = self._continue(command, is_download=False, now=now)
        data, transfer.data = transfer.data[:7], transfer.data[7:]
        if not transfer.data:
            self._transfer = None
        last = 0 if transfer.data else _LAST_BIT
        return bytes([command & _TOGGLE_BIT | 7 - len(data) << 1 | last]) + data.ljust(7, b"\0")

    def _continue(self, command: int, is_download: bool, now: float) -> _Transfer:
        transfer = self._transfer
        if transfer is None or transfer.is_download is not is_download:
            raise SdoAbortedError(COMMAND)
        if command & _TOGGLE_BIT != transfer.toggle:
            raise SdoAbortedError(TOGGLE)
        transfer.toggle ^= _TOGGLE_BIT
        transfer.stamp = now
        return transfer
