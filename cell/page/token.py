"""The token of the page: with it a page may move the cell, without it only watch."""

import hmac
import logging
import secrets
from pathlib import Path

from cell.records.kept_file import OWNER_ONLY
from drivers.errors import ConfigError
from drivers.figures_file import replace_text

FILE = "page-token"
"""Name of the token's file in the folder of the records; only the user of the cell may read it."""
SHORTEST = 16
"""Least number of characters of a token."""

logger = logging.getLogger(__name__)


def page_token(folder: Path) -> str:
    """Return the token of the cell with its records in `folder`; made once, so that it stays valid over restarts.

    Raises:
        ConfigError: The file cannot be read or written, or other users can read it.
    """
    path = folder / FILE
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        kept = _kept(path)
        if not kept:
            kept = secrets.token_urlsafe(18)
            replace_text(path, kept, mode=OWNER_ONLY)
        return kept
    except OSError as error:
        raise ConfigError(f"{path}: cannot be used: {error}") from None


def _kept(path: Path) -> str:
    """Return the token in a file; empty if it is missing or too short.

    Raises:
        ConfigError: Other users can read the file.
        OSError: The file cannot be read.
    """
    try:
        mode, token = path.stat().st_mode, path.read_bytes().decode(errors="replace").strip()
    except FileNotFoundError:
        return ""
    if mode & 0o077:
        raise ConfigError(f"{path}: others can read the page's token; only its owner allowed, as by chmod 600")
    if len(token) < SHORTEST or not token.isascii() or not token.isprintable():
        logger.warning("%s: holds no token of at least %d characters; made anew", path, SHORTEST)
        return ""
    return token


def is_token(found: object, token: str) -> bool:
    """Return True if a page has sent the right token; compared in constant time."""
    return isinstance(found, str) and bool(token) and hmac.compare_digest(found.encode(), token.encode())
