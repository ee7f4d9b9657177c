"""Frames on a serial line: consistent overhead byte stuffing [cobs] with a zero between frames; pure, no I/O.

Every frame carries a CRC of 16 bits after its content. If a reader starts in the middle of a frame or loses bytes, it
resynchronises at the next zero.
"""

from drivers.transport.crc import crc16

DELIMITER = 0
_RUN = 254


def frame(content: bytes) -> bytes:
    """Return the frame of `content` for the line, including the delimiter."""
    out = bytearray()
    data = content + crc16(content).to_bytes(2, "big")
    for run in data.split(b"\0"):
        while len(run) >= _RUN:
            out += bytes([_RUN + 1]) + run[:_RUN]
            run = run[_RUN:]
        out += bytes([len(run) + 1]) + run
    return bytes(out) + bytes([DELIMITER])


def unframe(stuffed: bytes) -> bytes | None:
    """Return the content between two delimiters, or None if it is not a complete, intact frame."""
    out = bytearray()
    at = 0
    while at < len(stuffed):
        code = stuffed[at]
        body = stuffed[at + 1 : at + code]
        if code == DELIMITER or len(body) != code - 1 or DELIMITER in body:
            return None
        out += body
        at += code
        if code != _RUN + 1 and at < len(stuffed):
            out.append(0)
    content, check = bytes(out[:-2]), bytes(out[-2:])
    return content if len(out) >= 2 and crc16(content).to_bytes(2, "big") == check else None


class Deframer:
    """Joins bytes to whole frames.

    Args:
        longest: Length of the longest valid content, bytes; more bytes without a delimiter are discarded.
    """

    def __init__(self, longest: int) -> None:
        self._limit = longest + 2 + (longest + 2) // _RUN + 2
        self._pending = bytearray()
        self.bytes = 0
        """Number of bytes received."""
        self.broken = 0
        """Number of frames discarded."""

    def feed(self, data: bytes) -> list[bytes]:
        """Take the received bytes; return the contents of the frames that they complete."""
        self.bytes += len(data)
        *ended, rest = (bytes(self._pending) + data).split(bytes([DELIMITER]))
        contents = []
        for stuffed in ended:
            content = unframe(stuffed) if stuffed else None
            if content is not None:
                contents.append(content)
            elif stuffed:
                self.broken += 1
        if len(rest) > self._limit:
            # One byte above the limit is kept, so that the rest of this frame is not read as a frame.
            rest = rest[: self._limit + 1]
        self._pending = bytearray(rest)
        return contents

    def reset(self) -> None:
        """Discard an incomplete frame."""
        self._pending.clear()
