"""Check that the skin shows a steady print of the peg, its trace of pressure, after the hand has closed.

A single frame with random readings of a faulty module can resemble a print. If a peg rests in the hand, every frame
shows its print and all modules repeat their readings to within noise.
"""

import numpy as np

from drivers.errors import SkinUntrustedError
from drivers.quantities import FINGER_NAMES, Mask, TaxelFrame
from drivers.skin.layout import Layout, layout_of, module_of

JUDGED = 8
"""Largest number of frames to judge after the first one: 0.8 s at 10 Hz."""
NEEDED = 3
"""Number of frames that decide: so many frames with the peg accept the print, so many with a restless module refuse it.

If the skin is noisy or the grip weak, most frames show the peg, but not all. Source: docs/tried/grasp.md.
"""
STEADY = 0.175
"""Largest median change of a module's readings between two frames while the peg rests, fraction of full scale.

Source: docs/tried/grasp.md.
"""


class GraspPrint:
    """Check of successive frames of a closed hand at rest, until enough frames show the peg or a restless module."""

    def __init__(self, layout: Layout) -> None:
        """Start without a frame of a skin with this layout."""
        self._layout = layout
        self._before: TaxelFrame | None = None
        self._judged = self._agreed = self._spoilt = 0
        self._restless = np.zeros(int(module_of(layout).max()) + 1, dtype=int)

    @property
    def is_judged(self) -> bool:
        """True if enough frames have been judged."""
        return max(self._agreed, self._spoilt) >= NEEDED or self._judged >= JUDGED

    def take(self, frame: TaxelFrame, is_print: bool) -> None:
        """Add one new frame; the first frame serves only as the reference of the second.

        Args:
            frame: The new frame.
            is_print: True if the estimator finds a peg in the frame.
        """
        before, self._before = self._before, frame
        if before is None:
            return
        restless = restless_modules(before, frame, self._layout)
        self._restless += restless
        is_spoilt = bool(restless.any())
        self._judged += 1
        self._spoilt += is_spoilt
        self._agreed += is_print and not is_spoilt

    def require(self) -> None:
        """Check that enough frames show the peg.

        Raises:
            SkinUntrustedError: Too few frames show the peg; the message names a module that is restless in most frames.
        """
        if self._agreed >= NEEDED:
            return
        frames = self._judged
        found = f"skin: no print of the peg since the hand closed on it: {self._agreed} of {frames} frames show it; {NEEDED} needed"
        worst = int(self._restless.argmax())
        if 2 * self._restless[worst] > frames:
            finger, module = divmod(worst, layout_of(self._layout).modules)
            raise SkinUntrustedError(
                f"{found}; {FINGER_NAMES[finger]} finger, module {module} reads at random: check its plug, or change the finger"
            )
        raise SkinUntrustedError(f"{found}; a line across both pads needed: look for it with `cell skin`")


def restless_modules(before: TaxelFrame, frame: TaxelFrame, layout: Layout) -> Mask:
    """Return a mask of the modules whose median change between two frames exceeds `STEADY`."""
    known = before.trusted & frame.trusted
    change = np.abs(frame.values - before.values)
    number, most = module_of(layout), STEADY * layout_of(layout).full_scale
    modules = [change[known & (module == number)] for module in range(int(number.max()) + 1)]
    return np.array([taxels.size > 0 and float(np.median(taxels)) > most for taxels in modules])
