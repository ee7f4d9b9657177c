"""Whether the order in which the skin's hub tells its taxels changes while it runs; pure, no I/O.

A hub that numbers its modules anew, or a plug that was drawn and put elsewhere, shows as one frame that agrees with the one
before only where modules or fingers have each other's places.
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
GAIN = 25.0
"""Log likelihood by which an exchange has to explain a frame better than the order before. Source: decision 0083."""


class TaxelOrder:
    """Follows the order of the taxels of one skin from frame to frame."""

    def __init__(self, noise: Vector | None = None) -> None:
        """Begin with the order of the baseline; `noise` is the standard deviation of each reading, shape (2, 20), counts, if known."""
        known = np.ones(FINGERS * TAXELS) if noise is None else np.maximum(noise.ravel(), 1.0)
        self._variance: Vector = 2.0 * known**2
        self._before: tuple[Vector, Vector, Mask] | None = None
        self._order = AS_TOLD

    def take(self, raw: Counts, values: Vector, trusted: Mask) -> None:
        """Take one frame: raw readings, counts, those above the baseline, counts, and which are trusted, each shape (2, 20)."""
        now, is_known = raw.astype(float).ravel(), trusted.ravel()
        if self._before is not None:
            self._compare(now, is_known, *self._before)
        self._before = now, values.ravel(), is_known

    def _compare(self, now: Vector, is_known: Mask, before: Vector, pressed: Vector, was_known: Mask) -> None:
        # Where the order before left the taxel whose reading each place has now.
        variance = self._variance + (CHANGE * pressed) ** 2

        def misfit(order: NDArray[np.intp]) -> tuple[float, float]:
            known = is_known & was_known[order]
            squares = ((now - before[order]) ** 2 / variance[order])[known]
            return 0.5 * float(squares.sum()), float(squares.mean()) if squares.size else np.inf

        as_before, _ = misfit(AS_TOLD)
        (exchanged, mean), order = min(
            ((misfit(order), order) for order in EXCHANGES.values()), key=lambda tried: tried[0]
        )
        if mean <= AGREES and as_before - exchanged > GAIN:
            self._order = self._order[order]

    def require(self) -> None:
        """Make sure that the taxels are told in the order of the baseline.

        Raises:
            SkinUntrustedError: They are not; the message says what is exchanged.
        """
        if (self._order == AS_TOLD).all():
            return
        which = [name for name, order in EXCHANGES.items() if (order == self._order).all()]
        raise SkinUntrustedError(
            f"skin: {which[0] if which else 'modules'} exchanged since the baseline: put their plugs back"
        )
