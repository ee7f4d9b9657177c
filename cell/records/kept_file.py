"""A small file written by a separate thread, so that the disk does not delay the caller."""

import logging
import os
from contextlib import suppress
from pathlib import Path
from threading import Condition, Thread

from drivers.figures_file import replace_text

logger = logging.getLogger(__name__)

OWNER_ONLY = 0o600
"""Permissions of every file of the records."""


class KeptFile:
    """One file. A text replaces its content wholly or not at all; a newer text replaces one that still waits."""

    def __init__(self, path: Path, what: str, is_void_if_late: bool = False) -> None:
        """Store the path and the use of its content.

        Args:
            path: The file.
            what: Content of the file, for messages.
            is_void_if_late: True to empty the file while the newest text cannot be written, because an older text is wrong.
        """
        self.path, self._what, self._is_void_if_late = path, what, is_void_if_late
        self._changed = Condition()
        self._text: str | None = None
        """Text that waits to be written; None if there is none."""
        self._is_at_work = False

    def put(self, text: str) -> None:
        """Queue a text for the file; once written, it survives a power failure. Never waits."""
        with self._changed:
            self._text = text
            if not self._is_at_work:
                self._is_at_work = True
                Thread(target=self._write, name="kept file", daemon=True).start()

    def flush(self, timeout: float) -> bool:
        """Wait up to `timeout`, s, until the newest text is written; return True if it is."""
        with self._changed:
            return self._changed.wait_for(lambda: not self._is_at_work, timeout)

    def _write(self) -> None:
        is_said = False
        while True:
            with self._changed:
                text, self._text = self._text, None
                if text is None:
                    self._is_at_work = False
                    self._changed.notify_all()
                    return
            try:
                replace_text(self.path, text, mode=OWNER_ONLY)
            except OSError as error:
                if not is_said:
                    is_said = True
                    logger.warning("%s: %s cannot be kept, tried again: %s", self.path, self._what, error.strerror)
                if self._is_void_if_late:
                    _empty(self.path)
                with self._changed:
                    self._text = text if self._text is None else self._text
                    # Delay between two attempts to write a text, s.
                    self._changed.wait(1.0)


def _empty(path: Path) -> None:
    """Empty a file; this works even on a full disk."""
    with suppress(OSError):
        os.close(os.open(path, os.O_CREAT | os.O_TRUNC | os.O_WRONLY, OWNER_ONLY))
