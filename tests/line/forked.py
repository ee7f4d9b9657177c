"""Calls of the command `cell` at a tenth of the cost: forks of one process that has loaded all modules.

    python tests/line/forked.py FOLDER MODULE...

imports the modules, writes the command into the folder, says so in a line, and obeys it until it is killed.
"""

import importlib
import json
import os
import runpy
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

LIBRARIES = ("mujoco", "numba", "numpy", "pyarrow", "pydantic", "pymodbus.client")
"""What is loaded for a program that differs from this tree's."""
COMMAND = """#!{python} -SE
import json, os, socket, sys
server = socket.socket(socket.AF_UNIX)
server.connect({address!r})
call = json.dumps([os.getcwd(), sys.argv[1:], {{name: text for name, text in os.environ.items() if name[:4] == "XDG_"}}])
socket.send_fds(server, [call.encode()], [0, 1, 2])
sys.exit(int(server.recv(9) or 1))
"""


def main(folder: Path, modules: Sequence[str]) -> None:
    """Obey calls of the command in a folder."""
    del sys.path[0]
    for name in modules:
        importlib.import_module(name)
    command, address = folder / "cell", str(folder / "socket")
    server = socket.socket(socket.AF_UNIX)
    server.bind(address)
    server.listen()
    command.write_text(COMMAND.format(python=sys.executable, address=address), encoding="utf-8")
    command.chmod(0o755)
    sys.stdout.write(f"{command}\n")
    sys.stdout.flush()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for the watchers
    while True:
        caller, _ = server.accept()
        if not os.fork():
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            call, streams, *_ = socket.recv_fds(caller, 1 << 20, 3)
            if not (called := os.fork()):
                obey(*json.loads(call), streams)
            caller.sendall(b"%d" % os.waitstatus_to_exitcode(os.waitpid(called, 0)[1]))
            os._exit(0)
        caller.close()


def obey(place: str, words: list[str], variables: dict[str, str], streams: list[int]) -> None:
    """Be the program that was called."""
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
    os.chdir(place)
    os.environ.update(variables)
    sys.argv[1:] = words
    runpy.run_module("cell", run_name="__main__", alter_sys=True)
    sys.exit()


@contextmanager
def forked(folder: Path, root: Path, *modules: str) -> Iterator[Path]:
    """Yield the command, in a folder, of the program in the tree `root`."""
    environment = {**os.environ, "PYTHONPATH": str(root)}
    line = [sys.executable, "-B", __file__, folder, *(modules or LIBRARIES)]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True, env=environment, cwd=root) as server:
        try:
            assert server.stdout is not None
            yield Path(server.stdout.readline().rstrip("\n"))
        finally:
            server.kill()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
