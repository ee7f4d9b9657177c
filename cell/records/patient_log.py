"""Logging that never waits: a thread writes lines from a bounded queue; if the queue is full, new lines are dropped."""

import logging
import math
import os
import threading
import time
from collections import deque
from typing import TextIO

MOST = 10_000
"""Largest number of waiting lines."""
FLUSH_TIME = 1.0
"""Longest time to write waiting lines at the end, s."""
PERIOD = 10.0
"""Least time between two lines of a kind, s."""


class SparseFilter(logging.Filter):
    """Passes one line of each kind per period and counts the others, so that a faulty client cannot fill the log."""

    def __init__(self) -> None:
        """Begin without a line."""
        super().__init__()
        self._kinds: dict[tuple[str, str], tuple[float, int]] = {}
        """Time of the next permitted line, s, and number of lines left out since the last one; the key is logger and format text."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Return True if the line is to be written."""
        kind, now = (record.name, str(record.msg)), time.monotonic()
        due, left = self._kinds.get(kind, (-math.inf, 0))
        if now < due:
            self._kinds[kind] = due, left + 1
            return False
        if len(self._kinds) > 100:  # largest number of kinds of lines that are counted
            self._kinds.clear()
        self._kinds[kind] = now + PERIOD, 0
        if left:
            record.msg = f"{record.msg} ({left} more like this before)"
        return True


class PatientHandler(logging.Handler):
    """Writes lines to a stream on a separate thread, so that logging never waits for the stream's reader."""

    def __init__(self, stream: TextIO) -> None:
        """Keep the stream and start the thread."""
        super().__init__()
        self._stream = stream
        self._lines: deque[str] = deque()
        self._changed = threading.Condition()
        self._is_writing, self._is_closed = False, False
        self.dropped = 0
        """Number of lines dropped because the queue was full."""
        threading.Thread(target=self._write, name="log", daemon=True).start()

    def emit(self, record: logging.LogRecord) -> None:
        """Queue one line."""
        line = self.format(record)
        with self._changed:
            if len(self._lines) >= MOST:
                self.dropped += 1
                return
            self._lines.append(line)
            self._changed.notify_all()

    def flush(self) -> None:
        """Wait up to `FLUSH_TIME` until all lines are written."""
        with self._changed:
            self._changed.wait_for(lambda: not self._lines and not self._is_writing, FLUSH_TIME)

    def close(self) -> None:
        """End the thread after it has written the queued lines."""
        super().close()
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()

    def _write(self) -> None:
        told = 0
        while True:
            with self._changed:
                self._is_writing = False
                self._changed.notify_all()
                self._changed.wait_for(lambda: bool(self._lines) or self._is_closed)
                if not self._lines:
                    return
                lines = [*self._lines]
                self._lines.clear()
                self._is_writing = True
                if self.dropped > told:
                    lines.append(f"{self.dropped - told} lines of the log were dropped: their reader was too slow")
                    told = self.dropped
            try:
                self._put("".join(f"{line}\n" for line in lines))
            except (OSError, ValueError):
                # The reader has closed the stream; the cell continues without a log.
                continue

    def _put(self, text: str) -> None:
        """Write without the stream's buffer: a blocked thread would hold the buffer's lock and block the end of the program.

        Raises:
            OSError: The reader has closed the stream.
            ValueError: The stream is closed.
        """
        try:
            file = self._stream.fileno()
        except OSError:  # a stream in memory
            self._stream.write(text)
            self._stream.flush()
            return
        data = text.encode(errors="backslashreplace")
        while data:
            data = data[os.write(file, data) :]
