"""A cell that a process of its own serves, for tests that talk to it over its ports."""

import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any


@contextmanager
def process(
    folder: Path,
    sets: Sequence[str],
    *options: str,
    lines: int = 1,
    **how: Any,
) -> Iterator[tuple[subprocess.Popen[str], list[tuple[str, int]]]]:
    """Yield the process of `cell serve` with its records in a folder, and host and port of its first lines; it is killed."""
    words = [word for key in ("plc.modbus.port=0", *sets) for word in ("--set", key)]
    command = [sys.executable, "-m", "cell", "serve", "--journal", str(folder), *words, *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, **how) as running:
        try:
            assert running.stdout is not None
            told = [re.search(r"([\d.]+):(\d+)", running.stdout.readline()) for _ in range(lines)]
            yield running, [(found[1], int(found[2])) for found in told if found is not None]
        finally:
            running.kill()
