"""Where a fixture holds the hole, as learnt from part to part: a Kalman filter with drift and a gate; pure.

The hole of the n-th part is at f_n + s_n: f_n is the place of the fixture, which drifts by a normal step from part to part, and
s_n is the scatter of a single part in it. x and y are independent of each other.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated

from pydantic import Field

from drivers.config_model import ConfigModel
from drivers.parts import HolePrior
from skills.search.tour import Point

NEEDED = 2
"""Number of parts on end that have to agree before a place is believed."""
LEAST_DEVIATION = 2e-4
"""Smallest standard deviation that is told of a hole, m: the arm finds a seated peg no better."""
MEMORY = 20
"""Number of parts over which the scatter is averaged."""


class LearningConfig(ConfigModel):
    """[learning]: what a served cell takes over from part to part.

    Source: chosen, not measured; reason in decision 0025.
    """

    place: bool = True
    """Whether the cell learns where the hole of each recipe is, and searches there first. Source: decision 0025."""
    scatter: Annotated[float, Field(ge=1e-4, le=0.01)] = 0.001
    """Standard deviation of the hole's place between parts of one fixture that is assumed before parts have told, m. Source: assumed."""
    drift: Annotated[float, Field(ge=0.0, le=0.01)] = 0.0001
    """Standard deviation of the fixture's own move from one part to the next, m."""
    gate: Annotated[float, Field(ge=2.0, le=10.0)] = 4.0
    """Distance from where the hole was expected beyond which a hole is of another fixture, standard deviations."""
    longest_age: Annotated[float, Field(gt=0.0, le=3.2e7)] = 2592000.0
    """Time after which a learnt place is not used any more, s; the default is 30 days."""


@dataclass(frozen=True, slots=True)
class PlaceEstimate:
    """What is known of a fixture after some parts."""

    mean: Point
    """Place of the fixture, shape (2,), m, base frame."""
    variance: Point
    """Variance of that place along x and y, m²."""
    scatter: Point
    """Variance of a part's hole about the fixture along x and y, m²."""
    parts: int
    """Number of parts that it was learnt from."""
    stray: Point | None = None
    """Hole of the newest part where it did not fit, m, base frame; None where it did."""

    def prior(self, learning: LearningConfig) -> HolePrior | None:
        """Return where the next hole is likely; None is anywhere, before parts agree and after one that did not fit."""
        if self.parts < NEEDED or self.stray is not None:
            return None
        x, y = (max(math.sqrt(value), LEAST_DEVIATION) for value in self._spread(learning))
        return HolePrior(mean=self.mean, deviation=(x, y))

    def fits(self, hole: Point, learning: LearningConfig) -> bool:
        """Tell whether a hole, shape (2,), m, base frame, is one of this fixture."""
        spread = self._spread(learning)
        squares = ((h - m) ** 2 / s for h, m, s in zip(hole, self.mean, spread, strict=True))
        return math.sqrt(sum(squares)) <= learning.gate

    def after(self, hole: Point, learning: LearningConfig) -> "PlaceEstimate":
        """Return the estimate after a part whose hole was found at `hole`, shape (2,), m, base frame.

        A hole that does not fit is kept as a stray: the next one decides between the fixture that was known and a new one.
        """
        if self.fits(hole, learning):
            return self._updated(hole, learning)
        if self.stray is None:
            return replace(self, stray=hole)
        new = first_estimate(self.stray, learning)
        return new._updated(hole, learning) if new.fits(hole, learning) else replace(self, stray=hole)

    def _spread(self, learning: LearningConfig) -> Point:
        """Return the variances of the next hole about the mean, m²."""
        x, y = (v + s + learning.drift**2 for v, s in zip(self.variance, self.scatter, strict=True))
        return x, y

    def _updated(self, hole: Point, learning: LearningConfig) -> "PlaceEstimate":
        """Return the estimate after a hole that fits; Kalman's update along each axis, and a scatter that forgets."""
        parts = self.parts + 1
        mean, variance, scatter = zip(
            *(
                _along(h, m, v + learning.drift**2, s, 1.0 / min(parts + NEEDED, MEMORY))
                for h, m, v, s in zip(hole, self.mean, self.variance, self.scatter, strict=True)
            ),
            strict=True,
        )
        return PlaceEstimate((mean[0], mean[1]), (variance[0], variance[1]), (scatter[0], scatter[1]), parts)


def first_estimate(hole: Point, learning: LearningConfig) -> PlaceEstimate:
    """Return what one part tells, whose hole was found at `hole`, shape (2,), m, base frame."""
    spread = learning.scatter**2
    return PlaceEstimate(hole, (spread, spread), (spread, spread), 1)


def from_prior(prior: HolePrior, learning: LearningConfig) -> PlaceEstimate:
    """Return the estimate that a configured prior stands for, before any part."""
    x, y = prior.deviation
    spread = learning.scatter**2
    scatter = min(x * x / 2, spread), min(y * y / 2, spread)
    return PlaceEstimate(prior.mean, (x * x - scatter[0], y * y - scatter[1]), scatter, NEEDED)


def _along(hole: float, mean: float, variance: float, scatter: float, share: float) -> tuple[float, float, float]:
    """Return mean, variance and scatter along one axis after a hole; `share` is the weight of this part in the scatter."""
    gain, off = variance / (variance + scatter), hole - mean
    learnt = max(scatter + share * ((1.0 - gain) * off * off - scatter), LEAST_DEVIATION**2)
    return mean + gain * off, (1.0 - gain) * variance, learnt
