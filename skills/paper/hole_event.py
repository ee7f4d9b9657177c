"""Detection of the hole from a sudden change of the taxels' average: [gibbons], Sec. IV.

The push loads one pad more and the other pad less. The pads stiffen with load, so that the reading of the first pad rises
more than that of the second falls: the average over all taxels follows the push. If the peg loses its support, the average
falls. If the far wall then turns the peg in the hand, the average rises. [gibbons] prints "a sudden change" without a sign.
"""

from collections import deque

import numpy as np

from drivers.quantities import TaxelFrame

MEMORY = 10
"""Number of frames in the running average; chosen, not printed."""
LEAST_COMMON = 10
"""Least number of taxels trusted in all compared frames; if there are fewer, the change is unknown."""


class HoleEvent:
    """Detector of a sudden change of the taxels' average, over the taxels trusted in all stored frames."""

    def __init__(self, threshold: float) -> None:
        """Start without a frame.

        Args:
            threshold: Change from one frame to the next above which `update` reports the hole, fraction of the running
                average.
        """
        self._threshold = threshold
        self._frames: deque[TaxelFrame] = deque(maxlen=MEMORY + 1)

    def change(self, frame: TaxelFrame) -> float:
        """Add a frame; return the change since the last one, fraction of the running average, >= 0; 0 if unknown."""
        self._frames.append(frame)
        trusted = np.logical_and.reduce([each.trusted for each in self._frames])
        if len(self._frames) < 2 or np.count_nonzero(trusted) < LEAST_COMMON:
            return 0.0
        # a_k: average response of frame k; event if |a_k - a_(k-1)| / mean(a_0 ... a_(k-1)) > threshold
        a = np.array([each.values for each in self._frames])[:, trusted].mean(axis=1)
        running = float(a[:-1].mean())
        return abs(float(a[-2] - a[-1])) / running if running > 0.0 else 0.0

    def update(self, frame: TaxelFrame) -> bool:
        """Add a frame; return True if the change exceeds the threshold."""
        return self.change(frame) > self._threshold
