"""Whether a frame can be the print of a peg at all, before any angle is read from it; pure."""

import numpy as np

from drivers.quantities import Mask, Vector

MOST_BELOW = 0.25
"""Share of a frame's squares that may lie below the baseline, fraction; noise alone gives one half."""
LEAST_PRESSED = 3.0
"""Least number of taxels that a peg presses, counted as the number of equal readings with the same spread."""


def is_print(values: Vector, trusted: Mask) -> bool:
    """Return whether readings, counts, rise above the baseline and on more than a taxel or two."""
    known = np.where(trusted, values, 0.0)
    pressed = np.maximum(known, 0.0)
    squares = float(np.vdot(pressed, pressed))
    below = float(np.vdot(known, known)) - squares
    return squares > 0.0 and below <= MOST_BELOW * (squares + below) and pressed.sum() ** 2 >= LEAST_PRESSED * squares
