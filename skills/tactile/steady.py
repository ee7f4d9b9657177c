"""Whether the skin of a hand that has just closed shows one peg, frame after frame.

A single frame of a module that reads at random may look like a print. A peg that rests in the hand is a print in every frame, and all
modules then repeat their readings to within noise.
"""

import numpy as np

from drivers.errors import SkinUntrustedError
from drivers.quantities import FINGER_NAMES, FINGERS, Mask, TaxelFrame
from drivers.skin.layout import MODULE_OF, MODULES

JUDGED = 8
"""Largest number of frames that are judged after the first one: 0.8 s of a skin at 10 Hz."""
NEEDED = 3
"""Number of frames that show the peg from which the print is believed, and of those with a restless module from which it is refused. A noisy skin,
or a weak grip, shows the peg in most frames but not in all. Source: docs/tried/grasp.md.
"""
STEADY = 3500.0
"""Largest median change of a module's readings from one frame to the next of a peg at rest, counts. Source: docs/tried/grasp.md."""


class GraspPrint:
    """Gathers the frames of a closed hand at rest until they tell whether the skin shows the peg."""

    def __init__(self) -> None:
        """Begin without a frame."""
        self._before: TaxelFrame | None = None
        self._judged = self._agreed = self._spoilt = 0
        self._restless = np.zeros(FINGERS * MODULES, dtype=int)

    @property
    def is_judged(self) -> bool:
        """Whether enough frames have been taken."""
        return max(self._agreed, self._spoilt) >= NEEDED or self._judged >= JUDGED

    def take(self, frame: TaxelFrame, is_print: bool) -> None:
        """Take one new frame; `is_print` tells whether the estimator finds a peg in it. The first is only what the next is compared with."""
        before, self._before = self._before, frame
        if before is None:
            return
        restless = restless_modules(before, frame)
        self._restless += restless
        is_spoilt = bool(restless.any())
        self._judged += 1
        self._spoilt += is_spoilt
        self._agreed += is_print and not is_spoilt

    def require(self) -> None:
        """Make sure that enough frames show the peg.

        Raises:
            SkinUntrustedError: They do not; one line that names a module that does not repeat its readings, if there is one.
        """
        if self._agreed >= NEEDED:
            return
        frames = self._judged
        found = f"skin: no print of the peg since the hand closed on it: {self._agreed} of {frames} frames show it; {NEEDED} needed"
        worst = int(self._restless.argmax())
        if 2 * self._restless[worst] > frames:
            finger, module = divmod(worst, MODULES)
            raise SkinUntrustedError(
                f"{found}; {FINGER_NAMES[finger]} finger, module {module} reads at random: see its plug, or change the finger"
            )
        raise SkinUntrustedError(f"{found}; a line across both pads needed: run `cell skin`")


def restless_modules(before: TaxelFrame, frame: TaxelFrame) -> Mask:
    """Return which modules change more from one frame to the next than a peg at rest explains, shape (4,); single taxels do not count."""
    known = before.trusted & frame.trusted
    change = np.abs(frame.values - before.values)
    modules = [change[known & (module == MODULE_OF)] for module in range(FINGERS * MODULES)]
    return np.array([taxels.size > 0 and float(np.median(taxels)) > STEADY for taxels in modules])
