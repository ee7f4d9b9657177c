"""Cost of starting a command: its processor time, imported modules and compiled functions.

Each start is a separate process. Its time is processor time, user and system, so that other work on the computer has
little influence.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import NamedTuple

HEAVY = (
    *("can", "canopen", "cryptography", "cv2", "distributed", "matplotlib", "mujoco", "numba", "pyarrow", "pymodbus"),
    *("scipy", "serial"),
)
"""Packages that a command may import only if it uses them."""
SHOWING: dict[str, tuple[str, ...]] = {
    "--help": ("--help",),
    "--version": ("--version",),
    "faults": ("faults",),
    "map": ("map",),
    "runs": ("runs",),
    "study --help": ("study", "--help"),
    "trials --help": ("trials", "--help"),
}
"""Commands that only display data; `runs` reads the user's own journal unless a folder is given."""
_CHILD = """
import json, os, sys
compiled = []
if "compiled" in sys.argv[1]:
    from numba.core import event
    class Count(event.Listener):
        def on_start(self, seen): compiled.append(seen)
        def on_end(self, seen): pass
    event.register("numba:compile", Count())
from cell.__main__ import main
told = os.dup(1)
sys.argv[:2] = ["cell"]
try:
    status = main()
except SystemExit as ended:
    status = ended.code
os.write(told, ("\\n" + json.dumps([status, len(compiled), sorted(sys.modules)])).encode())
"""


class Start(NamedTuple):
    """Result of one start of a command."""

    modules: list[str]
    """Names of all modules imported at the end of the command."""
    compiled: int
    """Number of functions compiled because the cache did not contain them; 0 if they were not counted."""


def processor_time(arguments: Sequence[str]) -> float:
    """Return the processor time of one start of Python with these arguments, user and system, s.

    The program can keep its bytecode, as an installed one does, whatever the environment sets.

    Raises:
        RuntimeError: The program failed.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    process = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL, env=environment)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise RuntimeError(f"python {' '.join(arguments)}: exit status {process.returncode}")
    return used.ru_utime + used.ru_stime


def start_of(arguments: Sequence[str], environment: Mapping[str, str] | None = None, counts: bool = False) -> Start:
    """Run one command of the program; a server is interrupted as soon as it prints that it serves.

    Args:
        arguments: The command and its options.
        environment: Variables in addition to those of this process.
        counts: True to count compilations, which imports the compiler.

    Raises:
        RuntimeError: The command failed.
    """
    command = [sys.executable, "-c", _CHILD, "compiled" if counts else "-", *arguments]
    variables = os.environ | dict(environment or {})
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=variables) as process:
        assert process.stdout is not None
        line = ""
        for line in process.stdout:
            if line.startswith("serving on"):
                process.send_signal(signal.SIGINT)
    status, compiled, modules = json.loads(line) if line.startswith("[") else (process.returncode, 0, [])
    if status:
        raise RuntimeError(f"cell {' '.join(arguments)}: exit status {status}")
    return Start(modules, compiled)


def heavy_imports(arguments: Sequence[str]) -> list[str]:
    """Return the heavy packages that one command imports."""
    return list(filter(start_of(arguments).modules.__contains__, HEAVY))
