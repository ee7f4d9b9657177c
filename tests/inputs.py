"""Number of random inputs at a boundary: `INPUTS=100000 python -m pytest FILE` tries that many."""

import os


def inputs(quick: int) -> int:
    """Return the number that the environment states, else `quick`."""
    return int(os.environ.get("INPUTS", quick))
