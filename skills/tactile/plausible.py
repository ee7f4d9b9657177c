"""Plausibility of a frame as the print of a peg, checked before an angle is estimated; pure."""

import numpy as np

from drivers.quantities import Mask, Vector

MOST_BELOW = 0.25
"""Largest share of a frame's squares below the baseline, fraction; noise alone gives one half."""
LEAST_PRESSED = 3.0
"""Least effective number of taxels pressed by a peg, (sum y)² / sum y²."""


def is_print(values: Vector, trusted: Mask) -> bool:
    """Return True if the readings, counts, exceed the baseline on at least `LEAST_PRESSED` taxels."""
    # sum of y² over y < 0 <= MOST_BELOW · sum of y², and (sum y)² / sum y² >= LEAST_PRESSED over y > 0
    known = np.where(trusted, values, 0.0)
    pressed = np.maximum(known, 0.0)
    squares = float(np.vdot(pressed, pressed))
    below = float(np.vdot(known, known)) - squares
    return squares > 0.0 and below <= MOST_BELOW * (squares + below) and pressed.sum() ** 2 >= LEAST_PRESSED * squares
