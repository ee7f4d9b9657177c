"""The token of the page: whoever has it may move the cell, everybody else may only look."""

import hmac
import os
import secrets
from pathlib import Path

from drivers.errors import ConfigError

FILE = "page-token"
"""Name of the token's file in the folder of the records; only the user of the cell may read it."""
BYTES = 18
"""Number of random bytes of a new token."""


def page_token(folder: Path) -> str:
    """Return the token of the cell whose records are in `folder`; made once, so that pages outlive a restart.

    Raises:
        ConfigError: The file cannot be read or written, or others can read it.
    """
    path = folder / FILE
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        try:
            with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
                file.write(secrets.token_urlsafe(BYTES))
        except FileExistsError:
            pass
        if path.stat().st_mode & 0o077:
            raise ConfigError(f"{path}: others can read the page's token; only its owner allowed, as by chmod 600")
        return path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeError) as error:
        raise ConfigError(f"{path}: cannot be used: {error}") from None


def is_token(found: object, token: str) -> bool:
    """Tell whether a page has shown the token; how long that takes tells nothing about it."""
    return isinstance(found, str) and bool(token) and hmac.compare_digest(found.encode(), token.encode())
