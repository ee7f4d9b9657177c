"""The file of the makers' host program as a port of a skin: `cyskin_acquisition --buffer file --filename FILE`.

The host program starts the hub and appends one line a sample. The first line has the channels' numbers,
uid = sui << 4 | name. Every other line has a sample number, the time since the start, s, and one reading for each channel,
counts [cyskin]. A sample holds each channel's last received reading, so it can be one hub period, 50 ms, old.
"""

import os
from pathlib import Path
from typing import BinaryIO

import numpy as np

from drivers.errors import DeviceNotOpenedError
from drivers.skin.board_config import HostSkinConfig
from drivers.skin.dialogue import RawScan, TaxelPlaces


class HostFile:
    """Follows the end of the file; this class is both port and link, because nothing is sent."""

    def __init__(self, config: HostSkinConfig) -> None:
        self._config = config
        self._file: BinaryIO | None = None
        self.link = self
        self.forget()

    def forget(self) -> None:
        """Discard everything received."""
        self._uids: tuple[int, ...] = ()
        self._first_seen: tuple[int, ...] = ()
        self._refused = 0
        self.restart()

    def restart(self) -> None:
        """Let the next exchange open the file again, because the host program may have started a new one."""
        self.is_started, self._is_stale = False, True

    @property
    def changed(self) -> str:
        """Text that names the differences from the channels of the first opening; empty if they are the same."""
        if self._uids == self._first_seen:
            return ""
        return f"{self._config.file}: other channels than when the skin was opened"

    def open(self) -> None:
        """Open the file and skip its present content, which was measured earlier.

        Raises:
            DeviceNotOpenedError: The file cannot be read, or its first line names no channels.
        """
        self.close()
        try:
            self._file = Path(self._config.file).open("rb")  # noqa: SIM115, closed by `close`
        except OSError as error:
            raise DeviceNotOpenedError(
                f"skin: {self._config.file}: {error.strerror}; start "
                f"cyskin_acquisition --buffer file --filename {self._config.file}, or see skin.file"
            ) from error
        self._is_stale, self._rest, self._uids = False, b"", ()
        head = self._file.readline()
        if not head.endswith(b"\n"):
            self._is_stale = True  # the program has only just begun the file
            return
        try:
            self._uids = tuple(int(word) for word in head.split())
            self._places = TaxelPlaces(self._uids, self._config.board)
        except ValueError:
            raise DeviceNotOpenedError(
                f"skin: {self._config.file}: first line {head[:40]!r}; the channels' numbers needed, as "
                "cyskin_acquisition --buffer file writes them"
            ) from None
        self._first_seen = self._first_seen or self._uids
        # Reading starts at the last byte, so the first piece is the end of an existing line.
        self._file.seek(max(self._file.seek(0, os.SEEK_END) - 1, len(head) - 1))
        self._is_whole = False

    def close(self) -> None:
        """Close the file; may be called again."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def exchange(self, now: float) -> list[RawScan]:
        """Return the samples appended since the last call; the newest one gets the time `now`, the others earlier times.

        Raises:
            DeviceNotOpenedError: The file is gone.
        """
        samples = [sample for line in self._lines() if (sample := self._sample(line)) is not None]
        return [self._places.scan(counts, now - samples[-1][0] + time, 0) for time, counts in samples]

    def _lines(self) -> list[bytes]:
        """Return the whole lines appended since the last call; a file that was replaced is opened again."""
        if self._is_stale or self._file is None or os.fstat(self._file.fileno()).st_size < self._file.tell():
            self.open()
        if self._is_stale or self._file is None:
            return []
        *lines, self._rest = (self._rest + self._file.read()).split(b"\n")
        if lines and not self._is_whole:
            self._is_whole = True
            del lines[0]
        return lines

    def _sample(self, line: bytes) -> tuple[float, np.ndarray[tuple[int, ...], np.dtype[np.uint16]]] | None:
        """Return time, s, and readings, counts, of a line; None if the line is not a sample."""
        try:
            _, time, *readings = line.split()
            counts = np.array(readings, dtype=np.int64)
            # Largest reading of a channel, counts.
            if len(counts) != len(self._uids) or counts.min() < 0 or counts.max() > 0xFFFF:
                raise ValueError
            self.is_started = True
            return float(time), counts.astype(np.uint16)
        except (ValueError, OverflowError):
            self._refused += 1
            return None

    def refused(self) -> int:
        """Return the number of lines that are not samples."""
        return self._refused

    def trouble(self) -> str:
        """Return the reason why no scan arrives."""
        if not self._uids:
            return f"{self._config.file} has no first line yet: check whether cyskin_acquisition found its hub"
        return f"{self._config.file} no longer grows: check cyskin_acquisition and the hub"
