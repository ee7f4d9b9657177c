"""The moment at which the peg falls into the hole, as the skin feels it: [gibbons], Sec. IV.

While the peg is pushed on the surface, one pad carries more and the other less, and a stiffening pad gains
more than its partner loses; when the support goes, the average over all taxels falls.
"""

from collections import deque
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from drivers.parts import ConfigModel
from drivers.quantities import TaxelFrame, Vector

LEAST_COMMON = 10
"""Averages of fewer taxels, trusted in all frames that are compared, are not compared."""


class HoleEventParams(ConfigModel):
    """How a fall of the average is told from noise."""

    method: Literal["difference", "cusum"] = "difference"
    """Numerical differentiation as in [gibbons], or the sum of all falls below the running average ([page], CUSUM)."""
    threshold: Annotated[float, Field(gt=0.0, lt=1.0)]
    """Fall that counts, fraction of the running average: over `span` frames, or what the sum reaches."""
    span: Annotated[int, Field(ge=1, le=100)] = 1
    """Frames from which the difference is taken; 1 in [gibbons]."""
    memory: Annotated[int, Field(ge=1, le=1000)] = 10
    """Frames that the running average is made of, the newest not among them."""
    slack: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.02
    """What the sum forgives at each frame, fraction of the running average."""


class HoleEvent:
    """Watches the average of all trusted taxels, frame by frame.

    Frames are compared over the taxels that are trusted in all of them, so that a taxel that drops out is no
    fall. An event is reported at the first frame that shows it; a sum starts anew after it.
    """

    def __init__(self, params: HoleEventParams) -> None:
        """Start with nothing seen."""
        self._params = params
        self._frames: deque[TaxelFrame] = deque(maxlen=max(params.memory, params.span) + 1)
        self._sum = 0.0
        self._is_falling = False
        self.count = 0
        """Events so far."""
        self.stamp: float | None = None
        """Time of the frame that showed the last event, s."""

    def update(self, frame: TaxelFrame) -> bool:
        """Take a new frame; return whether it shows the peg falling."""
        self._frames.append(frame)
        was_falling, self._is_falling = self._is_falling, self._fall() > self._params.threshold
        is_event = self._is_falling and not was_falling
        if is_event:
            self._sum = 0.0
            self.count += 1
            self.stamp = frame.stamp
        return is_event

    def _fall(self) -> float:
        """Return the fall up to the newest frame, fraction of the running average; 0 as long as too little is known."""
        params, averages = self._params, self._averages()
        if averages.size <= params.span:
            return 0.0
        running = float(averages[:-1][-params.memory :].mean())
        if running <= 0.0:
            return 0.0
        if params.method == "difference":
            return float(averages[-1 - params.span] - averages[-1]) / running
        self._sum = max(0.0, self._sum + 1.0 - float(averages[-1]) / running - params.slack)
        return self._sum

    def _averages(self) -> Vector:
        trusted = np.logical_and.reduce([frame.trusted for frame in self._frames])
        if np.count_nonzero(trusted) < LEAST_COMMON:
            return np.zeros(0)
        averages: Vector = np.array([frame.values[trusted].mean() for frame in self._frames])
        return averages
