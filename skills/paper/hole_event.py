"""The moment at which the peg falls into the hole, as the skin feels it: [gibbons], Sec. IV.

The pushed peg loads one pad more and the other less, and a stiffening pad gains more than its partner loses, so that
the average over all taxels follows the push. If the support goes, the average falls; if the far wall then turns the
peg in the hand, it rises. [gibbons] prints "a sudden change" of the average and not its sign.
"""

from collections import deque

import numpy as np

from drivers.quantities import TaxelFrame

MEMORY = 10
"""Number of frames that the running average is made of; chosen, not printed."""
LEAST_COMMON = 10
"""Least number of taxels, trusted in all compared frames, whose average counts."""


class HoleEvent:
    """Detects a sudden change of the average of the taxels that are trusted in all frames of its memory."""

    def __init__(self, threshold: float) -> None:
        """Begin without a frame; `threshold` is the change from one frame to the next that is an event, fraction of the running average."""
        self._threshold = threshold
        self._frames: deque[TaxelFrame] = deque(maxlen=MEMORY + 1)

    def change(self, frame: TaxelFrame) -> float:
        """Take a new frame; return the change since the last one, fraction of the running average, >= 0; 0 if unknown."""
        self._frames.append(frame)
        trusted = np.logical_and.reduce([each.trusted for each in self._frames])
        if len(self._frames) < 2 or np.count_nonzero(trusted) < LEAST_COMMON:
            return 0.0
        # a_k: average response of frame k; event if |a_k - a_(k-1)| / mean(a_0 ... a_(k-1)) > threshold
        a = np.array([each.values for each in self._frames])[:, trusted].mean(axis=1)
        running = float(a[:-1].mean())
        return abs(float(a[-2] - a[-1])) / running if running > 0.0 else 0.0

    def update(self, frame: TaxelFrame) -> bool:
        """Take a new frame; return whether it shows the peg at the hole."""
        return self.change(frame) > self._threshold
