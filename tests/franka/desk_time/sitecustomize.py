"""Time of the desk's world for every Python process of a cell on the desk.

`time.monotonic`, `time.time` and `time.sleep` follow the world. The world waits for the cell in turn: the main thread of a command, which
scans, writes the time that it has last seen, and the world goes no further than a few milliseconds beyond it.
"""

import atexit
import math
import mmap
import os
import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path

LOOK = 5e-4
"""Time between two looks at the world's time, s of wall time."""
NOW, SEEN = 0, 8
"""Places of the world's time and of the time that the cell has seen, bytes."""

with Path(os.environ["DESK_TIME"]).open("r+b") as _file:
    _times = mmap.mmap(_file.fileno(), 16)
_wait, _is_first = time.sleep, os.environ.setdefault("DESK_TIME_OF", str(os.getpid())) == str(os.getpid())


class _Now:
    """A callable that, as a built-in function, is not bound when it is an attribute of a class."""

    def __init__(self, zero: float, latest: Callable[[], float]) -> None:
        """Return the world's time plus `zero`, s, but nothing later than `latest`."""
        self._zero, self._latest = zero, latest

    def __call__(self) -> float:
        now: float = struct.unpack_from("d", _times, NOW)[0]
        if _is_first and threading.current_thread() is threading.main_thread():
            struct.pack_into("d", _times, SEEN, now)
        return min(self._zero + now, self._latest())


def _sleep(seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        _wait(LOOK)


time.monotonic, time.sleep = _Now(0.0, lambda: math.inf), _sleep
# The kernel stamps CAN frames with wall time: neither a slow nor a fast world makes them older than they are.
time.time = _Now(time.time() - time.monotonic(), time.time)
if _is_first:
    atexit.register(lambda: struct.pack_into("d", _times, SEEN, math.inf))
