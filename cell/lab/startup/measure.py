"""The cost of starting a command: processor time, and the heavy packages that it imports.

A technician waits for `cell faults` beside a cell that stands still; a fleet of small computers asks `cell runs` every
minute. Time is that of the processor, user and system, of a process of its own, so that other work on the computer
changes it little.
"""

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median

LIMIT = 0.6
"""Largest processor time of a command that only shows something, s."""
HEAVY = (
    *("can", "canopen", "cryptography", "cv2", "distributed", "matplotlib", "mujoco", "numba", "pyarrow", "pymodbus"),
    *("scipy", "serial"),
)
"""Packages that only commands which use them may import."""
COMMANDS: dict[str, tuple[str, ...]] = {
    "--help": ("--help",),
    "--version": ("--version",),
    "faults": ("faults",),
    "map": ("map",),
    "runs": ("runs",),
    "study --help": ("study", "--help"),
    "trials --help": ("trials", "--help"),
}
"""Commands that only show something; `runs` reads the user's own journal unless a folder is given."""
_LISTING = """
import json, os, sys
from cell.cli import main
out = os.dup(1)
os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
try:
    main(sys.argv[1:])
except SystemExit:
    pass
os.write(out, "\\n".join(name for name in sys.modules if "." not in name).encode())
"""


@dataclass(frozen=True, slots=True)
class StartLine:
    """Result for one command."""

    command: str
    time: float
    """Median of the processor time, s."""
    worst: float
    """Longest processor time, s."""
    starts: int
    heavy: str
    """Packages of `HEAVY` that it imported."""

    @property
    def holds(self) -> bool:
        """Whether the median is within the limit."""
        return self.time <= LIMIT


def measure(starts: int, journal: str, done: Callable[[], None]) -> list[StartLine]:
    """Start every command in processes of its own.

    Args:
        starts: Number of starts of each command.
        journal: Folder whose runs `runs` shows.
        done: Called after every command.
    """
    lines = []
    for name, arguments in COMMANDS.items():
        if name == "runs":
            arguments = (*arguments, "--journal", journal)
        times = [processor_time(arguments) for _ in range(starts)]
        lines.append(StartLine(name, median(times), max(times), starts, " ".join(heavy_imports(arguments))))
        done()
    return lines


def processor_time(arguments: Sequence[str]) -> float:
    """Return the processor time of one start of the program, user and system, s.

    The program may keep its bytecode, as an installed one does, whatever the environment says.

    Raises:
        RuntimeError: The command did not end well.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    process = subprocess.Popen([sys.executable, "-m", "cell", *arguments], stdout=subprocess.DEVNULL, env=environment)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise RuntimeError(f"cell {' '.join(arguments)}: exit status {process.returncode}")
    return used.ru_utime + used.ru_stime


def heavy_imports(arguments: Sequence[str]) -> list[str]:
    """Return the heavy packages that one command imports."""
    command = [sys.executable, "-c", _LISTING, *arguments]
    listed = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    return [name for name in HEAVY if name in listed]
