"""Maximum likelihood that also considers faults of a frame, once the frame is further off than noise explains.

The faults are a module that died unnoticed, a peg far off centre or with its end between the pads, and single taxels
that read anything. Each has a template bank or a mask of its own; the likeliest explanation is taken, and readings that
still do not fit are left out.

The breadth of the print that the peg leaves depends on the pads and the grip. It is all that other pads, or another
model of them, change for theta, and one frame tells it only roughly. Templates of several breadths are therefore
compared, and the belief about the breadth is kept from frame to frame. Where the peg ends between the pads, how far it
stands out of the hand changes the print as well: pegs that reach further or less far are compared beside.
"""

import math
from copy import copy
from typing import Annotated, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field

from drivers.parts import Peg
from drivers.quantities import Mask, TaxelFrame, Vector
from drivers.skin.layout import MODULE_EXCHANGES, MODULE_OF, Layout
from skills.tactile.likelihood import UNKNOWN_LOAD, Bank, Found, LikelihoodParams, pose_of, weights_of
from skills.tactile.pose import PegPose
from skills.tactile.templates import Templates, broad_templates, reaching_templates

BELOW = -6.0
"""Distance of a reading below its baseline that no pressure explains, standard deviations."""
SILENT = 4.0
"""Largest reading of a module that may be dead, standard deviations of the noise."""
MEDIAN_OF_NORMAL = 0.6745
BREADTHS = tuple(1.19**k for k in range(-3, 3))
"""Breadths of the prints that are compared, multiples of the configured one."""
AT_FIRST = (float(BREADTHS.index(1.0)), 8.0)
"""Prior belief about the breadth: its place among `BREADTHS` and one over the variance of that, which is 6 % of breadth."""
MOST_SURETY = 20.0
"""Largest precision of the belief about the breadth, 4 % of breadth; the breadth changes with the load."""
TURNED = math.radians(5.0)
"""Smallest turn of the peg since the last frame that updated the belief about the breadth, rad; frames of one angle err alike."""
LEARNING = 0.5
"""Share of such a frame's information on the breadth that is used, fraction; templates err as well."""
LOAD_SPREAD, LOAD_FRAMES = 0.15, 4
"""Standard deviation of the logarithm of a pad's load as expected beforehand, and the number of frames that this counts as."""
MOST_FRAMES = 20
"""Largest number of frames that the belief about the load counts as; another grip is learnt in as many."""
SURE = math.radians(1.5)
"""Largest sigma of an angle whose frame updates the belief about the load, rad; where two angles look alike their loads differ."""
OVERHANGS = tuple(1e-3 * k for k in range(-4, 9))
"""Lengths of the peg beyond the finger centre that are tried instead of the stated one, m, with prints of the
configured breadth.
"""
STEEPER = 3.5
"""Factor on the rise of the loads along such a peg, which bears the same moment on 23 mm of the pads instead of 35 mm: (35/23)³."""
REACH_STEP = 1.5e-3
REACHES = tuple(REACH_STEP * k for k in range(-2, 3))
"""Differences from the stated length of the peg beyond the finger centre that are compared in every frame, m."""
_MODULE = MODULE_OF.ravel()
MODULES = 4


class RobustParams(LikelihoodParams):
    """Parameters of maximum likelihood, and how strongly faults of a frame are considered.

    Source: chosen on simulated pads, its effect measured by `cell study tactile`.
    """

    kind: Literal["ml", "robust"] = "robust"
    """The estimator by maximum likelihood that also considers faults of a frame. Source: docs/tried/angle.md."""
    doubt: Annotated[float, Field(ge=1.0, le=100.0)] = 2.2
    """Misfit beyond which faults of a frame are considered, ratio of squared residuals to those expected."""
    rarity: Annotated[float, Field(ge=0.0, le=30.0)] = 5.0
    """Natural logarithm of the odds against each fault of a frame, ratio."""
    outlier: Annotated[float, Field(ge=2.0, le=20.0)] = 4.0
    """Distance from the rest at which a reading is left out, standard deviations."""
    most_outliers: Annotated[int, Field(ge=0, le=20)] = 4
    """Number of readings that are left out at the most."""
    reach_spread: Annotated[float, Field(ge=1e-4, le=0.01)] = 1e-3
    """Standard deviation of how much further than stated the peg stands out of the hand, m. Source: docs/tried/angle.md."""


class UsualPrints:
    """Prints of a peg that is held as stated, of several breadths, or that stands out of the hand a little more or less.

    The belief about the breadth is all that is remembered from frame to frame.
    """

    def __init__(self, params: RobustParams, breadths: Templates, reaches: Templates) -> None:
        """Prepare the comparison with prints of `BREADTHS` and of `REACHES`."""
        self._believed, self._taught = AT_FIRST, math.nan
        self._breadths, self._reaches = Bank(params, breadths), Bank(params, reaches)
        self._as_stated = (float(REACHES.index(0.0)), (REACH_STEP / params.reach_spread) ** 2)
        self.left = self._breadths.left
        """Residuals of the likelier of the two, over their standard deviations, shape (40,)."""

    def compare(
        self, values: Vector, weights: Vector, is_wide: bool = False, load: tuple[float, float] = UNKNOWN_LOAD
    ) -> Found:
        """Compare a frame with all of them; theta is the mean of both families by their odds."""
        broad = self._breadths.compare(values, weights, is_wide, self._believed, load)
        reaching = self._reaches.compare(values, weights, is_wide, self._as_stated, load)
        # Noise may be stronger than configured; both log likelihoods then shrink alike.
        scale = max(1.0, min(broad.misfit, reaching.misfit))
        # A peg that reaches further or less far is compared with the configured breadth alone, which may no longer be believed.
        place, surety = self._believed
        unlikely = 0.5 * surety * (place - AT_FIRST[0]) ** 2
        odds = (_evidence(broad, self._believed) - _evidence(reaching, self._as_stated) + unlikely) / scale
        share = 1.0 / (1.0 + math.exp(min(max(odds, -50.0), 50.0)))
        best, bank = (reaching, self._reaches) if share > 0.5 else (broad, self._breadths)
        self.left = bank.left
        away = math.remainder(reaching.theta - broad.theta, math.pi)
        spread = (1.0 - share) * broad.sigma**2 + share * reaching.sigma**2 + share * (1.0 - share) * away**2
        return best._replace(
            theta=math.remainder(broad.theta + share * away, math.pi),
            sigma=math.sqrt(spread),
            place=broad.place,
            surety=broad.surety,
        )

    def learn(self, found: Found) -> None:
        """Update the belief about the breadth of the print by one frame: a Kalman filter of a constant."""
        place, surety = self._believed
        if abs(math.remainder(found.theta - self._taught, math.pi)) < TURNED:
            return
        share = LEARNING / max(found.misfit, 1.0)
        told = share * (found.surety - surety)
        if told > 0.0:
            place += share * found.surety / (surety + told) * (found.place - place)
            self._taught = found.theta
            self._believed = min(max(place, 0.0), len(BREADTHS) - 1.0), min(surety + told, MOST_SURETY)


def _evidence(found: Found, believed: tuple[float, float]) -> float:
    """Return the log posterior of the likeliest angle with the place of the print integrated out, up to a constant of the frame."""
    return found.chance - 0.5 * math.log(max(found.surety, believed[1]) / believed[1])


class Load:
    """Belief about the load that a pad bears, learnt from frame to frame; only its constancy is known beforehand.

    The logarithm of the load is normal with unknown mean and variance. The variance has a scaled inverse chi-squared prior.
    """

    def __init__(self) -> None:
        """Begin without any expectation."""
        self._mean, self._count, self._squares, self._taught = 0.0, 0, 0.0, math.nan

    @property
    def expected(self) -> tuple[float, float]:
        """Expected `Found.whole` of the next frame, and one over its variance; 0 before the first frame that taught."""
        if self._count == 0:
            return UNKNOWN_LOAD
        variance = (LOAD_FRAMES * LOAD_SPREAD**2 + self._squares) / (LOAD_FRAMES + self._count - 1)
        return self._mean, 1.0 / (variance * (1.0 + 1.0 / self._count))

    def learn(self, found: Found) -> None:
        """Update the belief by one frame that is sure of its angle and whose peg has turned since the last."""
        if found.sigma > SURE or abs(math.remainder(found.theta - self._taught, math.pi)) < TURNED:
            return
        if self._count == MOST_FRAMES:
            self._squares *= 1.0 - 1.0 / MOST_FRAMES
        self._count, self._taught = min(self._count + 1, MOST_FRAMES), found.theta
        away = found.whole - self._mean
        self._mean += away / self._count
        self._squares += (1.0 - 1.0 / self._count) * away * away


Prints = Bank | UsualPrints


class Explanation(NamedTuple):
    """One explanation of a frame, compared with it."""

    against: float
    """Log odds against it beforehand."""
    found: Found
    bank: Prints
    weights: Vector
    """Weights of the readings under it, shape (40,)."""
    is_wide: bool
    """Whether all offsets were tried."""
    left: Vector
    """Residuals over their standard deviations, shape (40,)."""


class RobustEstimator:
    """Maximum likelihood that considers faults of a frame, and remembers one number, the breadth of the print."""

    def __init__(self, params: RobustParams, layout: Layout, peg: Peg) -> None:
        """Make the templates of every explanation that is considered."""
        self._params = params
        near = tuple(max(peg.overhang + reach, 0.0) for reach in REACHES)
        short = tuple(overhang for overhang in OVERHANGS if overhang < peg.overhang)
        reaching = reaching_templates(layout, peg, params.templates, near + short)
        broad = broad_templates(layout, peg, params.templates, BREADTHS)
        self._usual = UsualPrints(params, broad, reaching.part(0, len(near)))
        steep = params.model_copy(update={"rise": STEEPER * params.rise, "common_rise": STEEPER * params.common_rise})
        self._short = Bank(steep, reaching.part(len(near), len(near) + len(short)))
        self._against_short = params.rarity + math.log(max(len(short), 1))
        """Log odds against a peg that ends between the pads, at any one of the lengths that are tried."""
        self._load = Load()

    def __copy__(self) -> Self:
        """Return an estimator with the same templates that has learnt the same and goes on to learn for itself."""
        other = object.__new__(type(self))
        other.__dict__ |= self.__dict__ | {"_usual": copy(self._usual), "_load": copy(self._load)}
        return other

    def estimate(self, frame: TaxelFrame) -> PegPose:
        """Return the pose of the peg in `frame`; see `skills.tactile.pose.Estimator`."""
        params = self._params
        values = frame.values.ravel()
        trusted = frame.trusted.ravel() & (values > BELOW * params.noise)
        weights = weights_of(params, values, trusted)
        is_loud = (values > SILENT * params.noise) & (weights > 0.0)
        if not is_loud.any():
            return PegPose(0.0, 0.0, math.pi / 2, 1.0, False, frame.stamp)
        bank: Prints = self._usual
        found = bank.compare(values, weights, load=self._load.expected)
        silent = self._silent(is_loud, weights)
        if found.misfit > params.doubt or silent:
            found, bank, weights = self._think_again(values, weights, silent, found)
        seen = TaxelFrame(frame.values, (weights > 0.0).reshape(frame.trusted.shape), frame.stamp, 0)
        pose = pose_of(params, found, seen)
        if pose.healthy:
            self._load.learn(found)
            if bank is self._usual:
                self._usual.learn(found)
        return pose

    def order_odds(self, frame: TaxelFrame) -> Vector:
        """Return log odds that modules have each other's places; see `skills.tactile.order.TellsOrder`."""
        params = self._params
        values, trusted = frame.values.ravel(), frame.trusted.ravel() & (frame.values.ravel() > BELOW * params.noise)
        as_told = self._usual.compare(values, weights_of(params, values, trusted))
        odds, found = np.zeros(len(MODULE_EXCHANGES)), [as_told]
        for number, told in enumerate(MODULE_EXCHANGES.values()):
            moved = values[told]
            found.append(self._usual.compare(moved, weights_of(params, moved, trusted[told])))
            odds[number] = found[-1].chance - as_told.chance
        if max(each.load for each in found) < params.least_load:
            return np.zeros_like(odds)
        # Noise may be stronger than configured; all log likelihoods then shrink alike.
        return odds / max(1.0, min(each.misfit for each in found))

    def _silent(self, is_loud: Mask, weights: Vector) -> list[int]:
        """Return the modules without any reading above the noise."""
        loud = np.bincount(_MODULE, is_loud, MODULES)
        present = np.bincount(_MODULE, weights > 0.0, MODULES)
        return [int(module) for module in np.flatnonzero((loud == 0) & (present > 0))]

    def _think_again(
        self, values: Vector, weights: Vector, silent: list[int], usual: Found
    ) -> tuple[Found, Prints, Vector]:
        """Return the likeliest explanation of the frame, its bank and the weights that it leaves."""
        params, load = self._params, self._load.expected
        tried = [Explanation(0.0, usual, self._usual, weights, False, self._usual.left.copy())]

        def add(against: float, bank: Prints, weights: Vector, is_wide: bool = False) -> None:
            found = bank.compare(values, weights, is_wide, load=load)
            tried.append(Explanation(against, found, bank, weights, is_wide, bank.left.copy()))

        if usual.misfit > params.wide_misfit:
            add(0.0, self._usual, weights, is_wide=True)
        for module in silent:
            without = np.where(module == _MODULE, 0.0, weights)
            add(params.rarity, self._usual, without)
            add(params.rarity + self._against_short, self._short, without)
        add(self._against_short, self._short, weights)
        # Noise may be stronger than configured; all log likelihoods then shrink alike.
        scale = max(1.0, min(each.found.misfit for each in tried))
        odds = np.array([each.found.chance / scale - each.against for each in tried])
        best = tried[int(odds.argmax())]
        shares = np.exp(odds - odds.max())
        away = np.array([each.found.theta - best.found.theta for each in tried])
        away -= np.pi * np.round(away / np.pi)
        found, left = self._without_outliers(values, best)
        # Explanations that are about as likely widen sigma.
        sigma = math.hypot(found.sigma, math.sqrt(shares @ away**2 / shares.sum()))
        return found._replace(sigma=sigma), best.bank, left

    def _without_outliers(self, values: Vector, best: Explanation) -> tuple[Found, Vector]:
        """Leave out readings that do not fit, the worst first, until none is left or `most_outliers` are left out."""
        _, found, bank, weights, was_wide, left = best
        is_wide, load = found.misfit > self._params.wide_misfit, self._load.expected
        if is_wide != was_wide:
            found, left = bank.compare(values, weights, is_wide, load=load), bank.left
        for _ in range(self._params.most_outliers):
            away = np.abs(left)
            usual = max(1.0, float(np.median(away[weights > 0.0])) / MEDIAN_OF_NORMAL) if weights.any() else math.inf
            worst = int(away.argmax())
            if away[worst] < self._params.outlier * usual:
                break
            weights = np.where(np.arange(weights.size) == worst, 0.0, weights)
            found, left = bank.compare(values, weights, is_wide, load=load), bank.left
        return found, weights
