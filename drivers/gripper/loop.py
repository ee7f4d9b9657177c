"""The process that communicates with the Franka hand: `python -m drivers.gripper.loop HOST`.

The maker's library blocks until the fingers have arrived, which can take seconds; the cell must not wait for it.
Commands are lines on the standard input, each with a number; answers are lines on the standard output:

    N grasp WIDTH SPEED FORCE INNER OUTER | N move WIDTH SPEED   ->  done N grasp|move 1|0
    (while no command is under way)                              ->  state WIDTH 1|0 (it holds something)
    (when the hand refuses a command)                            ->  failed N TEXT
    (when the connection is lost; ends the commands sent before) ->  lost TEXT
"""

import select
import sys
import time
from typing import Any, BinaryIO

import pylibfranka


def main() -> None:
    """Serve the cell that started this process until the cell closes its end of the pipe."""
    host, gripper, reported = sys.argv[1], None, 0.0
    # Without a buffer: `select` does not see a line that waits in a buffer of this process.
    commands = open(sys.stdin.fileno(), "rb", buffering=0, closefd=False)  # noqa: SIM115, open until the process ends
    while True:
        try:
            if gripper is None:
                gripper = pylibfranka.Gripper(host)
            if _is_waiting(commands) and not _serve(gripper, commands.readline()):
                return
            state = gripper.read_once()
            # Time between two states, s; 10 ms is sufficient for the cell's scan.
            if time.monotonic() >= reported + 0.01:
                reported = time.monotonic()
                print("state", state.width, int(state.is_grasped), flush=True)
        except BrokenPipeError:
            return
        except (RuntimeError, pylibfranka.FrankaException) as error:  # the bases of the library's errors
            gripper = None
            print("lost", str(error).replace("\n", " "), flush=True)
            # Time between two attempts to connect, s.
            while _is_waiting(commands, 0.5):
                if not commands.readline():
                    return


def _is_waiting(commands: BinaryIO, timeout: float = 0.0) -> bool:
    """Return True if a command, or the end of the pipe, arrives within `timeout`, s."""
    return bool(select.select([commands], [], [], timeout)[0])


def _serve(gripper: Any, line: bytes) -> bool:
    """Obey a command; return False if the line is empty because the cell has closed its end of the pipe."""
    if line:
        number, method, *figures = line.decode().split()
        try:
            print("done", number, method, int(getattr(gripper, method)(*map(float, figures))), flush=True)
        except pylibfranka.CommandException as error:
            print("failed", number, str(error).replace("\n", " "), flush=True)
    return bool(line)


if __name__ == "__main__":
    main()
