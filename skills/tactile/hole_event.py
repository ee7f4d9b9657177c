"""The moment at which the peg falls into the hole, as the skin feels it: [gibbons], Sec. IV.

While the peg is pushed on the surface, one pad carries more and the other less, and a stiffening pad gains more than
its partner loses, so that the average over all taxels follows the push. When the support goes, the average falls; when
the peg's edge then meets the far wall and is turned in the hand, it rises and stays high. The detectors therefore look
for a change either way. [gibbons] prints "a sudden change" of the average, not its sign, and so is `derivative`.

A threshold that is not set by hand follows from a stated rate of false alarms. Each frame is expressed in standard
deviations of the noise that the frames before it showed, by Student's t as a normal deviate, so that a noise known from
few frames is not believed too much.
"""

import math
from collections import deque
from statistics import NormalDist
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel
from drivers.quantities import TaxelFrame, Vector

LEAST_COMMON = 10
"""Smallest number of taxels trusted in all compared frames for which averages are compared."""
LEAST_KNOWN = 3
"""Smallest number of deviations from which the noise is estimated."""
NOISE_MEMORY = 300
"""Number of frames after which the weight of a deviation in the noise has fallen to 1/e."""
OUTLIER = 3.0
"""Largest deviation that enters the noise, standard deviations; a slip is not noise."""


class HoleEventParams(ConfigModel):
    """How a change of the average is told from noise."""

    method: Literal["derivative", "difference", "cusum"] = "cusum"
    """How a hole event is detected. `derivative` is the change from one frame to the next, against `threshold`, as in
    [gibbons]; `difference` compares the mean of the newest `span` frames with those before; `cusum` sums all deviations
    beyond half of `step` ([page], two-sided)."""
    threshold: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.2
    """Change that counts for `derivative`, fraction of the running average; set by hand. Source: chosen, not measured;
    reason in decision 0025.
    """
    false_alarms: Annotated[float, Field(gt=0.0, le=100.0)] = 1e-3
    """Events that noise alone may cause in a search that lasts until its timeout, count; for `difference` and `cusum`.
    Source: chosen, the rate that comes of it measured by `cell study events`.
    """
    span: Annotated[int, Field(ge=1, le=100)] = 3
    """Number of frames that `difference` takes together. Source: chosen, not measured; reason in decision 0025."""
    memory: Annotated[int, Field(ge=1, le=1000)] = 20
    """Number of frames that the running average is made of, the newest not among them. Source: chosen, not measured;
    reason in decision 0025.
    """
    step: Annotated[float, Field(ge=0.5, le=10.0)] = 3.0
    """Smallest change that `cusum` shall find, standard deviations of the noise. Source: chosen, not measured; reason in decision 0025."""


class HoleEvent:
    """Watches the average of all trusted taxels, frame by frame.

    Frames are compared over the taxels that are trusted in all of them, so that a taxel that drops out is no change. An
    event is reported at the first frame that shows it; the sum and the running average then start anew.
    """

    def __init__(self, params: HoleEventParams, horizon: float) -> None:
        """Start without any frame; `horizon`, s, is the time to which the rate of false alarms refers."""
        self._params, self._horizon = params, horizon
        self._span = params.span if params.method == "difference" else 1
        self._frames: deque[TaxelFrame] = deque(maxlen=params.memory + self._span)
        self._sums = np.zeros(2)
        self._variance, self._known = 0.0, 0
        self._is_falling = False
        self.count = 0
        """Number of events so far."""
        self.stamp: float | None = None
        """Time of the frame that showed the last event, s."""

    def update(self, frame: TaxelFrame) -> bool:
        """Take a new frame; return whether it shows the peg at the hole."""
        was_falling, self._is_falling = self._is_falling, self.take(frame) > self.limit()
        is_event = self._is_falling and not was_falling
        if is_event:
            self.count += 1
            self.stamp = frame.stamp
            if self._params.method != "derivative":
                self.restart()
        return is_event

    def restart(self) -> None:
        """Forget the running average, but not its noise: the peg goes on under another load."""
        self._frames.clear()
        self._sums[:] = 0.0
        self._is_falling = False

    def take(self, frame: TaxelFrame) -> float:
        """Take a new frame; return the statistic that is compared with `limit`, 0 as long as too few frames are known."""
        self._frames.append(frame)
        averages, span = self._averages(), self._span
        if averages.size <= span:
            return 0.0
        running = float(averages[:-span].mean())
        if running <= 0.0:
            return 0.0
        if self._params.method == "derivative":
            return abs(float(averages[-2] - averages[-1])) / running
        deviate = self._deviate(_scaled(averages, span))
        self._learn(_scaled(averages, 1))
        if self._params.method == "difference":
            return abs(deviate)
        self._sums = np.maximum(self._sums + np.array([deviate, -deviate]) - self._params.step / 2.0, 0.0)
        return float(self._sums.max())

    def limit(self) -> float:
        """Return the size of the statistic that is an event; infinite before two frames have told their distance in time."""
        params = self._params
        if params.method == "derivative":
            return params.threshold
        if len(self._frames) < 2:
            return math.inf
        period = (self._frames[-1].stamp - self._frames[0].stamp) / (len(self._frames) - 1)
        return limit(params, params.false_alarms * period / self._horizon)

    def _deviate(self, change: float) -> float:
        """Return the normal deviate that is as rare as `change` is by Student's t (Wallace, 1959)."""
        if self._known < LEAST_KNOWN or self._variance <= 0.0:
            return 0.0
        n = min(self._known, NOISE_MEMORY)
        size = (8.0 * n + 1.0) / (8.0 * n + 3.0) * math.sqrt(n * math.log1p(change * change / self._variance / n))
        return math.copysign(size, change)

    def _learn(self, change: float) -> None:
        """Update the noise by one more deviation."""
        square = change * change
        if self._known >= LEAST_KNOWN:
            square = min(square, OUTLIER**2 * self._variance)
        self._known += 1
        self._variance += (square - self._variance) / min(self._known, NOISE_MEMORY)

    def _averages(self) -> Vector:
        trusted = np.logical_and.reduce([frame.trusted for frame in self._frames])
        if np.count_nonzero(trusted) < LEAST_COMMON:
            return np.zeros(0)
        averages: Vector = np.array([frame.values for frame in self._frames])[:, trusted].mean(axis=1)
        return averages


def _scaled(averages: Vector, span: int) -> float:
    """Return the mean of the newest `span` frames less the mean of those before, in standard deviations of a single frame."""
    before = averages[:-span]
    return float(averages[-span:].mean() - before.mean()) / math.sqrt(1.0 / span + 1.0 / before.size)


def limit(params: HoleEventParams, chance: float) -> float:
    """Return the limit of the statistic that noise alone passes with this chance in each frame.

    For a sum the false alarms come out as stated; for differences, which overlap and pass together, they are fewer.
    """
    if params.method == "derivative":
        return params.threshold
    chance = min(max(chance, 1e-12), 0.5)
    return normal_limit(chance) if params.method == "difference" else page_limit(params.step / 2.0, 2.0 / chance)


def normal_limit(chance: float) -> float:
    """Return the size that a normal deviate exceeds, in either direction, with this chance."""
    return NormalDist().inv_cdf(1.0 - chance / 2.0)


def page_limit(slack: float, run_length: float) -> float:
    """Return the limit at which a one-sided sum of [page] over white noise has this average run length.

    By the approximation of [siegmund], (exp(2 k b) - 2 k b - 1) / 2 k² with b = h + 1.166, solved for h.

    Args:
        slack: Allowance k that the sum subtracts at each frame, standard deviations, > 0.
        run_length: Average number of frames from one false alarm to the next.
    """
    low, high = 0.0, math.log(2.0 * slack * slack * run_length + 2.0) + 20.0
    for _ in range(60):
        middle = (low + high) / 2.0
        if math.expm1(middle) - middle < 2.0 * slack * slack * run_length:
            low = middle
        else:
            high = middle
    return max(high / (2.0 * slack) - 1.166, 0.0)
