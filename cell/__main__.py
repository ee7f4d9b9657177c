"""Entry point of `python -m cell` and of the command `cell`.

Worker processes import this module again, so that it imports what a command needs only when that command is run.
"""

import gc
import signal
import sys


def main() -> int:
    """Run one command and return its exit status."""
    try:
        from drivers.errors import CellError

        try:
            from cell.cli import main as run
        except CellError as error:
            # Faults of a catalogue show when it is read.
            sys.stderr.write(f"{error}\n")
            return 2
        return run()
    except (
        KeyboardInterrupt
    ):  # before the command line listens, or a second time while what was interrupted is put in order
        sys.stderr.write("cell: stopped\n")
        return 1
    finally:
        # Whatever the interpreter still has to put in order, another Ctrl-C ends it at once.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        gc.freeze()  # what is left goes with the process; looking for cycles in it would take half a second


if __name__ == "__main__":
    sys.exit(main())
