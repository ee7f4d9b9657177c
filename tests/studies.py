"""Studies run as commands, and the rows that they write."""

import csv
import io
import json
import pickle
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any
from unittest.mock import patch

from cell.commands.cli import GOOD, main
from cell.lab import trials, workers


def here(
    task: Callable[[int], Any], seeds: Sequence[int], processes: int, is_enough: Callable[[], bool] = lambda: False
) -> Iterator[Any]:
    """Yield what `on_processes` yields, from this process: another one would load and compile all of it once more."""
    task = pickle.loads(pickle.dumps(task))
    yield from (task(seed) for seed in seeds if not is_enough())


@contextmanager
def in_this_process() -> Iterator[None]:
    """Keep studies from starting processes."""
    with patch.object(trials, "on_processes", here), patch.object(workers, "on_processes", here):
        yield


def studied(folder: Path, name: str, *words: str) -> dict[str, Any]:
    """Run a study into a folder and return its figures."""
    with in_this_process(), redirect_stdout(io.StringIO()) as printed:
        assert main(["study", name, "--json", *words, "--out", str(folder)]) == GOOD
    found: dict[str, Any] = json.loads(printed.getvalue())
    return found


def rows_of(file: Path) -> list[dict[str, str]]:
    """Return the rows of a table."""
    with file.open(encoding="utf-8") as table:
        return list(csv.DictReader(table))


def is_chart(file: Path) -> bool:
    """Return True if a file is a picture that is not blank."""
    return file.read_bytes()[:4] == b"\x89PNG" and file.stat().st_size > 10_000
