"""Detection of exchanged skin modules from the print of a newly grasped peg: its trace of pressure on the taxels.

The back end of the peg is between the pads, so the print is longer towards the tip than towards the palm. If the two
modules of a finger are exchanged, that finger's print is turned by half a turn. If the fingers are exchanged, the print
is mirrored. A mirrored print equals that of a peg at the opposite angle, so one print cannot detect exchanged fingers.
"""

import math
from typing import Protocol, runtime_checkable

import numpy as np

from drivers.errors import SkinUntrustedError
from drivers.quantities import TaxelFrame, Vector
from drivers.skin.layout import Layout, module_exchanges
from skills.tactile.steady import NEEDED

EXCHANGED = math.log(1000.0)
"""Mean log odds per frame above which modules count as exchanged; the prior is one exchange in 1000 grasps."""


@runtime_checkable
class TellsOrder(Protocol):
    """Estimator with templates, which can therefore detect exchanged modules from a print."""

    def order_odds(self, frame: TaxelFrame) -> Vector:
        """Return the log odds of each of `module_exchanges` against the configured order; all 0 if the frame shows no print."""


class PrintOrder:
    """Evidence of exchanged modules, collected over the frames of one grasp."""

    def __init__(self, estimator: object, layout: Layout) -> None:
        """Start without a frame; if `estimator` has no `order_odds` or `layout` has no exchanges, the check is disabled."""
        self._names = list(module_exchanges(layout))
        self._estimator = estimator if self._names and isinstance(estimator, TellsOrder) else None
        self._odds: list[Vector] = []

    def take(self, frame: TaxelFrame) -> None:
        """Add one new frame, measured while the hand holds a peg in free space."""
        if self._estimator is not None:
            self._odds.append(self._estimator.order_odds(frame))

    def require(self) -> None:
        """Check that the modules are in the configured places.

        Raises:
            SkinUntrustedError: The print fits exchanged modules better; the message names them.
        """
        if len(self._odds) < NEEDED:  # the errors of one frame can exceed a faint print
            return
        odds = np.mean(self._odds, axis=0)
        if odds.max() > EXCHANGED:
            which = self._names[int(odds.argmax())]
            raise SkinUntrustedError(
                f"skin: the print of the peg is turned by half a turn, as with {which} exchanged: check their plugs"
            )
