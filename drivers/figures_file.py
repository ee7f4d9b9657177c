"""Files of figures: read as a model, and written whole or not at all. If the program stops during a write, the old file stays."""

import os
import tomllib
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from drivers.errors import ConfigError

M = TypeVar("M", bound=BaseModel)


def read_toml(path: Path, what: str = "") -> dict[str, Any]:
    """Return the content of a TOML file; `what` names the file in the message of an error.

    Raises:
        ConfigError: The file is missing, is not readable, or is not TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}:{f' {what}' if what else ''} cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:  # the parser raises these if a number is too long, or a list too deep
        raise ConfigError(f"{path}: not TOML: {error}".replace("\n", " ")) from None


def read_figures(path: Path, kind: type[M], what: str = "") -> M:
    """Return the figures in a TOML file; its key `base` can name a second file in its folder for the missing figures.

    Args:
        path: The file.
        kind: Model of the figures.
        what: Word for the file in the message; empty for none.

    Raises:
        ConfigError: The file is missing, is not TOML, or its figures violate the model.
    """
    tree = read_toml(path, what)
    if isinstance(base := tree.get("base"), str):
        del tree["base"]
        tree = _laid_over(read_toml(path.parent / base), tree)
    try:
        return kind.model_validate(tree)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise ConfigError(f"{path}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from None


def _laid_over(base: dict[str, Any], tree: dict[str, Any]) -> dict[str, Any]:
    """Return `base` with the values of `tree` in place of its own; inner tables are merged, lists are replaced."""
    both = {
        key: _laid_over(base[key], value)
        for key, value in tree.items()
        if isinstance(value, dict) and isinstance(base.get(key), dict)
    }
    return {**base, **tree, **both}


def write_whole(path: Path, text: str, what: str) -> None:
    """Write a text file; create its folder if it is missing; `what` names the file in the message of an error.

    Raises:
        ConfigError: The file cannot be written; a previous file stays.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_text(path, text)
    except OSError as error:
        raise ConfigError(f"{path}: {what} cannot be written: {error.strerror}") from None


def replace_text(path: Path, text: str, *, mode: int = 0o666) -> None:
    """Replace the text of a file, whole or not at all; afterwards the new text survives a power failure.

    Raises:
        OSError: The file cannot be written.
    """
    beside = path.with_suffix(path.suffix + ".new")
    try:
        number = os.open(beside, os.O_CREAT | os.O_TRUNC | os.O_WRONLY, mode)
        with os.fdopen(number, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
        folder = os.open(path.parent, os.O_RDONLY)
        with suppress(OSError):  # not every file system can; without it, a power failure can bring the old text back
            os.fsync(folder)
        os.close(folder)
    except OSError:
        with suppress(OSError):
            beside.unlink()
        raise
