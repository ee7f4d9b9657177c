"""Prior of the hole's position in a fixture, learnt from part to part: a Kalman filter with drift and a gate; pure.

The hole of the n-th part is at f_n + s_n. The position f_n of the fixture drifts by a normal step from part to part, and
s_n is the scatter of a single part in it. x and y are independent.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

from pydantic import Field

from drivers.config_model import ConfigModel, Figure, Quantity, Source
from drivers.parts import HolePrior
from skills.search.tour import Point

NEEDED = 2
"""Number of successive parts that must agree before their estimate is used."""


class LearningConfig(ConfigModel):
    """[learning]: estimates that a served cell keeps from part to part."""

    SOURCE: ClassVar[str] = "chosen, not measured; reason in decision 0025"

    place: Annotated[bool, Source("decision 0025")] = True
    """True if the cell learns the position of the hole for each recipe and searches there first."""
    scatter: Annotated[float, Figure("m"), Field(exclude=True), Source("assumed")] = 0.001
    """Initial standard deviation of the hole's position between parts of one fixture, m."""
    drift: Annotated[float, Figure("m"), Field(exclude=True)] = 0.0001
    """Standard deviation of the fixture's motion from one part to the next, m."""
    gate: Annotated[float, Figure("standard deviations"), Field(exclude=True)] = 4.0
    """Distance from the expected position beyond which a hole belongs to another fixture, standard deviations."""
    longest_age: Annotated[float, Field(gt=0.0, le=3.2e7), Quantity("s")] = 2592000.0
    """Longest time for which a learnt position is used, s; the default is 30 days."""
    finest: Annotated[float, Figure("m"), Field(exclude=True), Source("chosen, not measured")] = 2e-4
    """Smallest standard deviation of a prior, m: the accuracy of the arm for a seated peg."""
    memory: Annotated[int, Figure("count"), Field(exclude=True)] = 20
    """Number of parts in the average of the scatter."""


@dataclass(frozen=True, slots=True)
class PlaceEstimate:
    """Estimate of a fixture's position after some parts."""

    mean: Point
    """Position of the fixture, shape (2,), m, base frame."""
    variance: Point
    """Variance of that position along x and y, m²."""
    scatter: Point
    """Variance of a part's hole about the fixture along x and y, m²."""
    parts: int
    """Number of parts in the estimate."""
    stray: Point | None = None
    """Hole of the newest part if it did not fit, m, base frame; None if it did."""

    def prior(self, learning: LearningConfig) -> HolePrior | None:
        """Return the prior of the next hole; None for no prior: before parts agree, and after a part that did not fit."""
        if self.parts < NEEDED or self.stray is not None:
            return None
        x, y = (max(math.sqrt(value), learning.finest) for value in self._spread(learning))
        return HolePrior(mean=self.mean, deviation=(x, y))

    def fits(self, hole: Point, learning: LearningConfig) -> bool:
        """Return True if a hole, shape (2,), m, base frame, belongs to this fixture."""
        # Mahalanobis distance: sqrt(sum((hole - mean)² / spread)) <= gate
        spread = self._spread(learning)
        squares = ((h - m) ** 2 / s for h, m, s in zip(hole, self.mean, spread, strict=True))
        return math.sqrt(sum(squares)) <= learning.gate

    def after(self, hole: Point, learning: LearningConfig) -> "PlaceEstimate":
        """Return the estimate after a part with its hole found at `hole`, shape (2,), m, base frame.

        If the hole does not fit, it is stored as a stray. The next hole decides between the known fixture and a new one.
        """
        if self.fits(hole, learning):
            return self._updated(hole, learning)
        if self.stray is None:
            return replace(self, stray=hole)
        new = first_estimate(self.stray, learning)
        return new._updated(hole, learning) if new.fits(hole, learning) else replace(self, stray=hole)

    def _spread(self, learning: LearningConfig) -> Point:
        """Return the variances of the next hole about the mean, m²."""
        # P + S + Q, Q = drift²
        x, y = (v + s + learning.drift**2 for v, s in zip(self.variance, self.scatter, strict=True))
        return x, y

    def _updated(self, hole: Point, learning: LearningConfig) -> "PlaceEstimate":
        """Return the estimate after a hole that fits: a Kalman update along each axis, and a moving average of the scatter."""
        parts = self.parts + 1
        mean, variance, scatter = zip(
            *(
                _along(h, m, v + learning.drift**2, s, 1.0 / min(parts + NEEDED, learning.memory), learning.finest)
                for h, m, v, s in zip(hole, self.mean, self.variance, self.scatter, strict=True)
            ),
            strict=True,
        )
        return PlaceEstimate((mean[0], mean[1]), (variance[0], variance[1]), (scatter[0], scatter[1]), parts)


def first_estimate(hole: Point, learning: LearningConfig) -> PlaceEstimate:
    """Return the estimate after one part with its hole found at `hole`, shape (2,), m, base frame."""
    spread = learning.scatter**2
    return PlaceEstimate(hole, (spread, spread), (spread, spread), 1)


def from_prior(prior: HolePrior, learning: LearningConfig) -> PlaceEstimate:
    """Return the estimate equivalent to a configured prior, before any part."""
    x, y = prior.deviation
    spread = learning.scatter**2
    scatter = min(x * x / 2, spread), min(y * y / 2, spread)
    return PlaceEstimate(prior.mean, (x * x - scatter[0], y * y - scatter[1]), scatter, NEEDED)


def _along(
    hole: float, mean: float, variance: float, scatter: float, share: float, finest: float
) -> tuple[float, float, float]:
    """Return mean, variance and scatter along one axis after a hole; `share` is the weight of this part in the scatter,
    whose root is `finest`, m, at least.
    """
    # K = P / (P + S), mean <- mean + K e, P <- (1 - K) P, S <- S + share ((1 - K) e² - S), e = hole - mean
    gain, off = variance / (variance + scatter), hole - mean
    learnt = max(scatter + share * ((1.0 - gain) * off * off - scatter), finest**2)
    return mean + gain * off, (1.0 - gain) * variance, learnt
