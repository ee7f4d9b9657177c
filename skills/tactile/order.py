"""Whether the modules of the skin have each other's places, told by the print of a peg that has just been grasped.

The peg ends between the pads, so that its print is longer towards the tip than towards the palm. A finger whose two modules
are exchanged shows the print turned by half a turn. Exchanged fingers show it mirrored, which is the print of a peg at the
opposite angle: no single print tells them.
"""

import math
from typing import Protocol, runtime_checkable

import numpy as np

from drivers.errors import SkinUntrustedError
from drivers.quantities import TaxelFrame, Vector
from drivers.skin.layout import MODULE_EXCHANGES

EXCHANGED = math.log(1000.0)
"""Mean log odds of a frame from which modules count as exchanged: one grasp in a thousand, it is taken, comes after an exchange."""
LEAST_FRAMES = 3
"""Number of frames below which nothing is said, for the errors of one may outweigh a faint print."""


@runtime_checkable
class TellsOrder(Protocol):
    """Estimator that can tell from a print whether modules have each other's places; those without templates cannot."""

    def order_odds(self, frame: TaxelFrame) -> Vector:
        """Return the log odds of each of `MODULE_EXCHANGES` against the modules as told, shape (3,); 0 where there is no print."""


class PrintOrder:
    """Gathers what the frames of one grasp say of the order of the modules."""

    def __init__(self, estimator: object) -> None:
        """Begin without a frame; an estimator that cannot tell says nothing."""
        self._estimator = estimator if isinstance(estimator, TellsOrder) else None
        self._odds: list[Vector] = []

    def take(self, frame: TaxelFrame) -> None:
        """Take one new frame of the hand that holds a peg clear of all."""
        if self._estimator is not None:
            self._odds.append(self._estimator.order_odds(frame))

    def require(self) -> None:
        """Make sure that the modules are where they are told to be.

        Raises:
            SkinUntrustedError: The print fits exchanged modules better; the message says which.
        """
        if len(self._odds) < LEAST_FRAMES:
            return
        odds = np.mean(self._odds, axis=0)
        if odds.max() > EXCHANGED:
            which = list(MODULE_EXCHANGES)[int(odds.argmax())]
            raise SkinUntrustedError(
                f"skin: the print of the peg is turned by half a turn, as with {which} exchanged: see their plugs"
            )
