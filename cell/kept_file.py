"""A small file that is kept up to date by a thread of its own, so that no disk holds up whoever changes it."""

import logging
import os
from pathlib import Path
from threading import Condition, Thread

logger = logging.getLogger(__name__)

OWNER_ONLY = 0o600
"""Permissions of the file."""


class KeptFile:
    """One file whose newest text reaches the disk whole or not at all; a text that is overtaken is not written."""

    def __init__(self, path: Path, what: str) -> None:
        """Take the path, and what is in the file, for messages."""
        self.path, self._what = path, what
        self._changed = Condition()
        self._text: str | None = None
        """Text that waits; None where nothing does."""
        self._is_lasting, self._is_at_work = False, False
        self.is_kept = True
        """Whether the text that was written last has reached the disk."""

    def put(self, text: str, is_lasting: bool) -> None:
        """Let the file have a text soon, with `is_lasting` also after a loss of power; never waits."""
        with self._changed:
            self._text, self._is_lasting = text, self._is_lasting or is_lasting
            if not self._is_at_work:
                self._is_at_work = True
                Thread(target=self._write, name="kept file", daemon=True).start()

    def flush(self, timeout: float) -> bool:
        """Wait at most so long, s, until the newest text is written; return whether it is."""
        with self._changed:
            return self._changed.wait_for(lambda: not self._is_at_work, timeout)

    def _write(self) -> None:
        while True:
            with self._changed:
                text, is_lasting = self._text, self._is_lasting
                self._text, self._is_lasting = None, False
                if text is None:
                    self._is_at_work = False
                    self._changed.notify_all()
                    return
            try:
                replace(self.path, text, is_lasting)
                self.is_kept = True
            except OSError as error:
                self.is_kept = False
                logger.warning("%s: %s cannot be kept: %s", self.path, self._what, error.strerror)


def replace(path: Path, text: str, is_lasting: bool) -> None:
    """Give a file a text, whole or not at all, with `is_lasting` also after a loss of power.

    Raises:
        OSError: It cannot be written.
    """
    beside = path.with_suffix(".tmp")
    with os.fdopen(os.open(beside, os.O_CREAT | os.O_TRUNC | os.O_WRONLY, OWNER_ONLY), "w", encoding="utf-8") as file:
        file.write(text)
        if is_lasting:
            file.flush()
            os.fsync(file.fileno())
    beside.replace(path)
