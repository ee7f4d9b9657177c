"""The process that communicates with the Franka hand: `python -m drivers.gripper.loop HOST`.

The maker's library blocks until the fingers have arrived, which can take seconds; the cell must not wait for it.
Commands are lines on the standard input; answers are lines on the standard output:

    grasp WIDTH SPEED FORCE INNER OUTER | move WIDTH SPEED   ->  done grasp|move 1|0
    (while no command is under way)                          ->  state WIDTH 1|0 (it holds something)
    (when the hand refuses a command)                        ->  failed TEXT
    (when the connection is lost)                            ->  lost TEXT
"""

import select
import sys
import time
from typing import Any

import pylibfranka


def main() -> None:
    """Serve the cell that started this process until the cell closes its end of the pipe."""
    host, gripper = sys.argv[1], None
    reported = 0.0
    while True:
        try:
            if gripper is None:
                gripper = pylibfranka.Gripper(host)
            if not _serve_command(gripper):
                return
            state = gripper.read_once()
            # Time between two states, s; 10 ms is sufficient for the cell's scan.
            if time.monotonic() >= reported + 0.01:
                reported = time.monotonic()
                print("state", state.width, int(state.is_grasped), flush=True)
        except pylibfranka.CommandException as error:
            print("failed", str(error).replace("\n", " "), flush=True)
        except BrokenPipeError:
            return
        except RuntimeError as error:  # base of the library's errors
            gripper = None
            print("lost", str(error).replace("\n", " "), flush=True)
            # Time between two attempts to connect, s.
            readable, _, _ = select.select([sys.stdin], [], [], 0.5)
            if readable and not sys.stdin.readline():
                return


def _serve_command(gripper: Any) -> bool:
    """Obey the next command, if there is one; return False if the cell has closed its end of the pipe."""
    readable, _, _ = select.select([sys.stdin], [], [], 0.0)
    if not readable:
        return True
    words = sys.stdin.readline().split()
    if words:
        print("done", words[0], int(_obey(gripper, words)), flush=True)
    return bool(words)


def _obey(gripper: Any, words: list[str]) -> bool:
    numbers = [float(word) for word in words[1:]]
    return bool(gripper.grasp(*numbers) if words[0] == "grasp" else gripper.move(*numbers))


if __name__ == "__main__":
    main()
