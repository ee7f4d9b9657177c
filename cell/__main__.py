"""Entry point of `python -m cell` and of the command `cell`.

Worker processes import this module again, so that it imports what a command needs only when that command is run.
"""

import sys


def main() -> int:
    """Run one command and return its exit status."""
    from drivers.errors import CellError

    try:
        from cell.cli import main as run
    except CellError as error:
        # Faults of a catalogue show when it is read.
        sys.stderr.write(f"{error}\n")
        return 2
    return run()


if __name__ == "__main__":
    sys.exit(main())
