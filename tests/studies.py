"""Studies run as commands, and the rows that they write."""

import csv
import io
import json
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

from cell.commands.cli import GOOD, main

ALONE = ("--workers", "1")
"""Options of a study that runs on one process, which all of them share."""


def studied(folder: Path, name: str, *words: str) -> dict[str, Any]:
    """Run a study into a folder and return its figures."""
    with redirect_stdout(io.StringIO()) as printed:
        assert main(["study", name, "--json", *words, "--out", str(folder)]) == GOOD
    found: dict[str, Any] = json.loads(printed.getvalue())
    return found


def rows_of(file: Path) -> list[dict[str, str]]:
    """Return the rows of a table."""
    with file.open(encoding="utf-8") as table:
        return list(csv.DictReader(table))


def is_chart(file: Path) -> bool:
    """Return whether a file is a picture with something on it."""
    return file.read_bytes()[:4] == b"\x89PNG" and file.stat().st_size > 10_000
