"""Far end of a serial port: a pseudo-terminal that can be unplugged and plugged in again under the same name."""

import fcntl
import os
import sys
import tempfile
import termios
import time
import tty
from pathlib import Path


class Terminal:
    """Board side of one serial port."""

    def __init__(self, name: str) -> None:
        """Choose the port's name; it does not exist yet."""
        self.port = str(Path(tempfile.gettempdir()) / f"{name}-{os.getpid()}-{id(self)}")
        """Name of the serial port; it stays the same if the board is plugged in again."""
        self.is_read_meanwhile = False
        """True if the reader is another thread or process; `send` then returns before the arrival of the bytes."""
        self._ends: tuple[int, int] | None = None

    def plug_in(self) -> None:
        """Create the port; no effect if it exists."""
        if self._ends is None:
            self._ends = os.openpty()
            tty.setraw(self._ends[1])
            Path(self.port).symlink_to(os.ttyname(self._ends[1]))

    def unplug(self) -> None:
        """Remove the port, even if it is open elsewhere; repeated calls are harmless."""
        if self._ends is not None:
            Path(self.port).unlink(missing_ok=True)
            for end in self._ends:
                os.close(end)
            self._ends = None

    def send(self, data: bytes) -> None:
        """Send bytes and wait for their arrival, so that the next read returns them even on a busy computer.

        Unread bytes are lost if the line is full, as in a USB adapter; all bytes are lost while it is unplugged.
        """
        if self._ends is None or not data:
            return
        far, near = self._ends
        arrived = _waiting(near) + len(data)
        # Number of unread bytes that the line keeps; a pseudo-terminal holds 4095.
        if arrived > 3000:
            return
        os.write(far, data)
        if self.is_read_meanwhile:
            return
        # Longest time in which the kernel forwards bytes, s of wall time.
        end = time.monotonic() + 5.0
        while _waiting(near) < arrived and time.monotonic() < end:
            os.sched_yield()


def _waiting(port: int) -> int:
    """Return the number of bytes that wait for a read."""
    return int.from_bytes(fcntl.ioctl(port, termios.FIONREAD, bytes(4)), sys.byteorder)
