"""Modbus RTU frames in a stream of bytes; pure, no I/O, no clock: the reader of the line detects silences.

Silence alone does not mark the ends of frames: a USB adapter delivers bytes in bursts, and a late reader receives several
frames at once. A frame is therefore valid if its function, its length and its check sum agree; silence only triggers the
search. The receiver joins the pieces of a frame, separates joined frames, and skips and counts noise around frames.
"""

from contextlib import suppress

from pymodbus.framer.rtu import FramerRTU

from plc_bridge.modbus.pdu import length_of

SHORTEST, LONGEST = 4, 256  # Modbus over Serial Line V1.02, 2.5.1: unit, function, data, check sum
BROADCAST = 0


def with_check_sum(frame: bytes) -> bytes:
    """Return `frame`, unit and PDU, with its CRC-16 appended, low byte first."""
    return frame + FramerRTU.compute_CRC(frame).to_bytes(2, "big")


def is_intact(frame: bytes) -> bool:
    """Return True if the check sum at the end of `frame` is right."""
    return len(frame) >= SHORTEST and with_check_sum(frame[:-2]) == frame


class Receiver:
    """Finds frames in the received bytes.

    Args:
        unit: Unit identifier of the cell. Frames of this unit are requests; frames of other units can also be responses.
    """

    def __init__(self, unit: int) -> None:
        self._unit = unit
        self._buffer = bytearray()
        self.bad = 0
        """Number of pieces of noise and of broken frames dropped so far."""

    @property
    def is_waiting(self) -> bool:
        """True if remaining bytes may be the beginning of a frame."""
        return bool(self._buffer)

    @property
    def is_full(self) -> bool:
        """True if the buffer exceeds the longest request and response together."""
        return len(self._buffer) > 2 * LONGEST

    def feed(self, data: bytes) -> None:
        """Take the received bytes."""
        self._buffer += data

    def take(self) -> list[bytes]:
        """Return the intact frames in order, each with unit and PDU but no check sum; call it when the line is silent."""
        frames = []
        while (place := self._find()) is not None:
            start, end = place
            self.bad += start > 0
            frames.append(bytes(self._buffer[start : end - 2]))
            del self._buffer[:end]
        if self.is_full:
            self.bad += 1
            del self._buffer[:-LONGEST]
        return frames

    def give_up(self) -> None:
        """Drop the beginning of a frame whose remainder did not arrive in time."""
        self.bad += bool(self._buffer)
        self._buffer.clear()

    def _find(self) -> tuple[int, int] | None:
        for start in range(len(self._buffer) - SHORTEST + 1):
            rest = bytes(self._buffer[start : start + LONGEST])
            for length in self._lengths(rest):
                if length <= len(rest) and is_intact(rest[:length]):
                    return start, start + length
            # a request with an unknown function or length is answered with an exception
            if start == 0 and len(self._buffer) <= LONGEST and is_intact(rest):
                return 0, len(rest)
        return None

    def _lengths(self, frame: bytes) -> list[int]:
        """Return the possible lengths of a frame with this beginning: as a request, and as another unit's response."""
        unit, function = frame[:2]
        lengths = []
        with suppress(NotImplementedError):
            lengths.append(3 + length_of(frame[1:]))  # unit and check sum
        if unit not in (self._unit, BROADCAST):
            # Functions whose response has the number of data bytes in its third byte.
            if function in (1, 2, 3, 4, 17, 23):
                lengths.append(5 + frame[2])
            elif function in (15, 16):
                lengths.append(8)
            elif function > 0x80:
                lengths.append(5)
        return lengths
