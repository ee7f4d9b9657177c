"""`python -m cell`, and what the command `cell` calls.

Worker processes import this module again: what they do not need is imported only when a command is run.
"""

import sys


def main() -> int:
    """Run one command and return its exit status."""
    from cell.cli import main as run

    return run()


if __name__ == "__main__":
    sys.exit(main())
