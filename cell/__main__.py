"""`python -m cell`."""

import sys

from cell.cli import main

if __name__ == "__main__":
    sys.exit(main())
