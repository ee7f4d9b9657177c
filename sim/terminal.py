"""The far end of a serial port: a pseudo-terminal that can be unplugged and plugged in again under the same name."""

import fcntl
import os
import sys
import tempfile
import termios
import time
import tty
from pathlib import Path

BUFFER = 3000
"""Number of unread bytes that the line keeps; a pseudo-terminal holds 4095."""
ARRIVAL_TIME = 5.0
"""Longest time until the kernel has passed bytes on, s of wall time."""


class Terminal:
    """One serial port as its board sees it."""

    def __init__(self, name: str) -> None:
        """Choose the port's name; it does not exist yet."""
        self.port = str(Path(tempfile.gettempdir()) / f"{name}-{os.getpid()}-{id(self)}")
        """Name of the serial port, which stays the same when the board is plugged in again."""
        self.is_read_meanwhile = False
        """Whether the reader is another thread or process, so that bytes need not be seen to arrive before `send` returns."""
        self._ends: tuple[int, int] | None = None

    def plug_in(self) -> None:
        """Make the port; one that exists is left as it is."""
        if self._ends is None:
            self._ends = os.openpty()
            tty.setraw(self._ends[1])
            Path(self.port).symlink_to(os.ttyname(self._ends[1]))

    def unplug(self) -> None:
        """Take the port away from whoever has it open; may be called again."""
        if self._ends is not None:
            Path(self.port).unlink(missing_ok=True)
            for end in self._ends:
                os.close(end)
            self._ends = None

    def send(self, data: bytes) -> None:
        """Put bytes on the line and see them arrive, so that whoever reads next has them, however busy the machine is.

        Bytes that nobody reads are lost once the line is full, as in a USB adapter; all are while it is unplugged.
        """
        if self._ends is None or not data:
            return
        far, near = self._ends
        arrived = _waiting(near) + len(data)
        if arrived > BUFFER:
            return
        os.write(far, data)
        if self.is_read_meanwhile:
            return
        end = time.monotonic() + ARRIVAL_TIME
        while _waiting(near) < arrived and time.monotonic() < end:
            os.sched_yield()


def _waiting(port: int) -> int:
    """Return how many bytes wait to be read."""
    return int.from_bytes(fcntl.ioctl(port, termios.FIONREAD, bytes(4)), sys.byteorder)
