"""Detection of modules or fingers of the skin that are exchanged while it runs; pure, no I/O.

An exchange happens if a hub numbers its modules anew, or if a plug is moved to another socket. Two successive frames then
agree only if the readings of one frame are exchanged. The frames before the exchange agree with each other, and so do the
frames after it. If instead the hand closes or the peg turns, more than one frame changes.
"""

import numpy as np
from numpy.typing import NDArray

from drivers.errors import SkinUntrustedError
from drivers.quantities import Mask, Vector
from drivers.skin.health import Counts
from drivers.skin.layout import Layout, exchanges, shape_of

Order = NDArray[np.intp]
"""Index of the reading that each taxel reports, shape (2 n,)."""
TOLD = 1
"""Number of frames that repeat the report of an exchange; the report ends every run, and a reset acknowledges it."""


class TaxelOrder:
    """Tracks the order of the taxels of one skin from frame to frame."""

    def __init__(self, layout: Layout, noise: Vector | None = None) -> None:
        """Begin with the order of the baseline; `noise` is the standard deviation of each reading, shape (2, n), counts, if available."""
        known = np.ones(shape_of(layout)) if noise is None else np.maximum(noise, 1.0)
        self._variance: Vector = 2.0 * known.ravel() ** 2
        self._exchanges, self._as_told = exchanges(layout), np.arange(known.size)
        self._before: tuple[Vector, Vector, Mask] | None = None
        self._was_steady, self._suspected = False, ""
        self._exchange, self._told = "", 0

    def take(self, raw: Counts, values: Vector, trusted: Mask) -> None:
        """Take one frame: raw readings and readings above the baseline, counts, and the trusted taxels, each shape (2, n)."""
        now, is_known = raw.astype(float).ravel(), trusted.ravel()
        found = "" if self._before is None else self._confirmed(now, is_known, *self._before)
        self._before = now, values.ravel(), is_known
        if found or self._told > TOLD:
            self._exchange, self._told = found, 0
        elif self._told:
            self._told += 1

    def _confirmed(self, now: Vector, is_known: Mask, before: Vector, pressed: Vector, was_known: Mask) -> str:
        """Return the exchange found in the previous frame if this frame confirms it; empty if there is none."""
        # Least log-likelihood ratio between an exchange and the previous order. Source: docs/tried/grasp.md.
        gain = 25.0
        # A pressed taxel usually changes by 5 % of its reading from frame to frame.
        variance = self._variance + (0.05 * pressed) ** 2

        def misfit(order: Order) -> tuple[float, float]:
            known = is_known & was_known[order]
            squares = ((now - before[order]) ** 2 / variance[order])[known]
            total = float(np.add.reduce(squares))
            return 0.5 * total, total / squares.size if squares.size else np.inf

        as_before, mean = misfit(self._as_told)
        # Frames agree up to 3 times the expected mean square difference.
        is_steady = mean <= 3.0
        found, self._suspected = self._suspected if is_steady else "", ""
        if self._was_steady and as_before > gain:
            (exchanged, mean), name = min((misfit(order), name) for name, order in self._exchanges.items())
            # Largest mean square difference if an exchange explains a frame, in the same units. An exchange under a
            # peg at rest leaves only the noise of the taxels; if a peg slips to about the mirrored angle, 2.8 and
            # more remain. Source: docs/tried/grasp.md.
            if mean <= 1.8 and as_before - exchanged > gain:
                self._suspected = name
        self._was_steady = is_steady
        return found

    def require(self) -> None:
        """Check that no modules or fingers were exchanged.

        Raises:
            SkinUntrustedError: There was an exchange; the message names it.
        """
        if self._exchange:
            self._told = max(self._told, 1)
            raise SkinUntrustedError(f"skin: {self._exchange} exchanged while the skin ran: check their plugs")
