"""`python -m cell`, and what the command `cell` calls.

Worker processes import this module again: what they do not need is imported only when a command is run.
"""

import sys


def main() -> int:
    """Run one command and return its exit status."""
    from drivers.errors import CellError

    try:
        from cell.cli import main as run
    except CellError as error:
        # What is wrong with a catalogue is found out when it is read.
        sys.stderr.write(f"{error}\n")
        return 2
    return run()


if __name__ == "__main__":
    sys.exit(main())
