"""Whether modules or fingers of the skin change places while it runs; pure, no I/O.

A hub that numbers its modules anew, or a plug that was drawn and put elsewhere, shows as one frame that agrees with the one
before only where modules or fingers have each other's places, while the frames before it agree with each other, and so do
those after it. A hand that closes, or a peg that turns, changes more than one frame.
"""

import numpy as np
from numpy.typing import NDArray

from drivers.errors import SkinUntrustedError
from drivers.quantities import FINGERS, TAXELS, Mask, Vector
from drivers.skin.health import Counts
from drivers.skin.layout import EXCHANGES

AS_TOLD: NDArray[np.intp] = np.arange(FINGERS * TAXELS)

CHANGE = 0.05
"""Change of a pressed taxel from frame to frame that is usual, fraction of its reading."""
AGREES = 3.0
"""Mean square of the differences, in units of the expected, up to which two frames agree."""
EXPLAINS = 1.8
"""The same, up to which an exchange explains a frame: a skin whose modules change places under a peg at rest shows the noise of its
taxels and no more, while a peg that slips to about the mirrored angle is left with 2.8 and more. Source: docs/tried/grasp.md."""
GAIN = 25.0
"""Log likelihood by which an exchange has to explain a frame better than the order before. Source: docs/tried/grasp.md."""
TOLD = 1
"""Number of further frames for which an exchange is told once somebody has asked: it ends every run, and a reset takes note of it."""


class TaxelOrder:
    """Follows the order of the taxels of one skin from frame to frame."""

    def __init__(self, noise: Vector | None = None) -> None:
        """Begin with the order of the baseline; `noise` is the standard deviation of each reading, shape (2, 20), counts, if known."""
        known = np.ones(FINGERS * TAXELS) if noise is None else np.maximum(noise.ravel(), 1.0)
        self._variance: Vector = 2.0 * known**2
        self._before: tuple[Vector, Vector, Mask] | None = None
        self._was_steady, self._suspected = False, ""
        self._exchange, self._told = "", 0

    def take(self, raw: Counts, values: Vector, trusted: Mask) -> None:
        """Take one frame: raw readings, counts, those above the baseline, counts, and which are trusted, each shape (2, 20)."""
        now, is_known = raw.astype(float).ravel(), trusted.ravel()
        found = "" if self._before is None else self._confirmed(now, is_known, *self._before)
        self._before = now, values.ravel(), is_known
        if found or self._told > TOLD:
            self._exchange, self._told = found, 0
        elif self._told:
            self._told += 1

    def _confirmed(self, now: Vector, is_known: Mask, before: Vector, pressed: Vector, was_known: Mask) -> str:
        """Return what had changed places in the frame before, if this one agrees with it; empty where nothing had."""
        variance = self._variance + (CHANGE * pressed) ** 2

        def misfit(order: NDArray[np.intp]) -> tuple[float, float]:
            known = is_known & was_known[order]
            squares = ((now - before[order]) ** 2 / variance[order])[known]
            return 0.5 * float(squares.sum()), float(squares.mean()) if squares.size else np.inf

        as_before, mean = misfit(AS_TOLD)
        is_steady = mean <= AGREES
        found = self._suspected if is_steady else ""
        (exchanged, mean), name = min((misfit(order), name) for name, order in EXCHANGES.items())
        is_jump = self._was_steady and mean <= EXPLAINS and as_before - exchanged > GAIN
        self._was_steady, self._suspected = is_steady, name if is_jump else ""
        return found

    def require(self) -> None:
        """Make sure that nothing has changed places.

        Raises:
            SkinUntrustedError: Something has; the message says what.
        """
        if self._exchange:
            self._told = max(self._told, 1)
            raise SkinUntrustedError(f"skin: {self._exchange} exchanged while the skin ran: see their plugs")
