"""Files that are written whole or not at all: a program that is stopped in between leaves the old one."""

import os
from pathlib import Path

from drivers.errors import ConfigError


def write_whole(path: Path, text: str, what: str) -> None:
    """Write a text file; its folder is made where it is missing.

    Args:
        path: The file.
        text: Content of the file.
        what: Word for the file in the message.

    Raises:
        ConfigError: The file cannot be written; one that was there before stays.
    """
    new = path.with_suffix(path.suffix + ".new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with new.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    except OSError as error:
        raise ConfigError(f"{path}: {what} cannot be written: {error.strerror}") from None
