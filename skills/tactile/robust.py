"""Maximum likelihood that also considers faults of a frame if the misfit exceeds the level that noise explains.

The faults are: a module that failed undetected, a peg far off centre, a peg whose back end is between the pads, and
single taxels with arbitrary readings. Each fault has its own template bank or mask. The estimator selects the likeliest
explanation and then leaves out readings that still do not fit.

A print is the peg's trace of pressure on the taxels. Its breadth depends on the pads and the grip. The breadth is the only
property of the pads that affects theta, and one frame measures it only roughly. The estimator therefore compares templates
of several breadths and keeps its estimate of the breadth from frame to frame. If the peg's back end is between the pads,
the peg's overhang also changes the print: its length inside the hand, beyond the finger centre. The estimator therefore
also compares pegs that reach further into the hand, and less far.
"""

import math
from copy import copy
from typing import NamedTuple, Self

import numpy as np

from drivers.parts import Peg
from drivers.quantities import Mask, TaxelFrame, Vector
from drivers.skin.layout import Layout, layout_of, module_exchanges, module_of
from skills.tactile.likelihood import UNKNOWN_LOAD, Bank, Found, RobustParams, pose_of, weights_of
from skills.tactile.pose import PegPose
from skills.tactile.templates import Templates, broad_templates, reaching_templates

MEDIAN_OF_NORMAL = 0.6745
BREADTHS = tuple(1.19**k for k in range(-3, 3))
"""Breadths of the compared prints, multiples of the configured breadth."""
AT_FIRST = (float(BREADTHS.index(1.0)), 8.0)
"""Prior of the breadth: its mean index in `BREADTHS`, and the precision 1/variance of that index; the standard deviation is 6 % of breadth."""
OVERHANGS = tuple(1e-3 * k for k in range(-4, 9))
"""Overhangs of a peg whose back end is between the pads, m; negative if the end is short of the finger centre. Their prints have the
configured breadth. Source: chosen, not measured."""
REACH_STEP = 1.5e-3
REACHES = tuple(REACH_STEP * k for k in range(-2, 3))
"""Differences from the stated overhang of the peg, compared in every frame, m."""


class UsualPrints:
    """Two families of prints: several breadths at the stated overhang, and several overhangs at the configured breadth.

    The estimated breadth is the only state kept from frame to frame.
    """

    def __init__(self, params: RobustParams, breadths: Templates, reaches: Templates) -> None:
        """Prepare the comparison with prints of `BREADTHS` and of `REACHES`."""
        self._params, self._believed, self._taught = params, AT_FIRST, math.nan
        self._breadths, self._reaches = Bank(params, breadths), Bank(params, reaches)
        self._as_stated = (float(REACHES.index(0.0)), (REACH_STEP / params.reach_spread) ** 2)
        self.left = self._breadths.left
        """Residuals of the likelier family over their standard deviations, shape (2 n,)."""

    def compare(
        self, values: Vector, weights: Vector, is_wide: bool = False, load: tuple[float, float] = UNKNOWN_LOAD
    ) -> Found:
        """Compare a frame with both families; theta is the mean of both, weighted by their odds."""
        broad = self._breadths.compare(values, weights, is_wide, self._believed, load)
        reaching = self._reaches.compare(values, weights, is_wide, self._as_stated, load)
        # If the noise exceeds the configured noise, both log likelihoods are scaled down by the same factor.
        scale = max(1.0, min(broad.misfit, reaching.misfit))
        # The prints of other overhangs have the configured breadth. If the estimated breadth differs from it, the log
        # likelihood of these prints is reduced by precision / 2 · (place - AT_FIRST)².
        place, surety = self._believed
        unlikely = 0.5 * surety * (place - AT_FIRST[0]) ** 2
        odds = (_evidence(broad, self._believed) - _evidence(reaching, self._as_stated) + unlikely) / scale
        share = 1.0 / (1.0 + math.exp(min(max(odds, -50.0), 50.0)))
        best, bank = (reaching, self._reaches) if share > 0.5 else (broad, self._breadths)
        self.left = bank.left
        # Mixture of two Gaussians with weights 1 - s and s: theta = theta_b + s (theta_r - theta_b),
        # sigma² = (1 - s) sigma_b² + s sigma_r² + s (1 - s) (theta_r - theta_b)²
        away = math.remainder(reaching.theta - broad.theta, math.pi)
        spread = (1.0 - share) * broad.sigma**2 + share * reaching.sigma**2 + share * (1.0 - share) * away**2
        return best._replace(
            theta=math.remainder(broad.theta + share * away, math.pi),
            sigma=math.sqrt(spread),
            place=broad.place,
            surety=broad.surety,
        )

    def learn(self, found: Found) -> None:
        """Update the estimated breadth of the print with one frame, if the peg has turned since the last update.

        The update is that of a Kalman filter of a constant.
        """
        place, surety = self._believed
        if abs(math.remainder(found.theta - self._taught, math.pi)) < self._params.turned:
            return
        share = self._params.learning / max(found.misfit, 1.0)
        # `found` includes the prior: the frame adds only the difference of the two precisions, times `share`.
        told = share * (found.surety - surety)
        if told > 0.0:
            place += share * found.surety / (surety + told) * (found.place - place)
            self._taught = found.theta
            self._believed = min(max(place, 0.0), len(BREADTHS) - 1.0), min(surety + told, self._params.most_surety)


def _evidence(found: Found, believed: tuple[float, float]) -> float:
    """Return the log posterior of the likeliest angle with the print integrated out, up to a constant of the frame."""
    # Laplace approximation with prior precision b and posterior precision s: ln p_best - 1/2 ln(s / b)
    return found.chance - 0.5 * math.log(max(found.surety, believed[1]) / believed[1])


class Load:
    """Estimate of the load of a pad, updated from frame to frame; the load is assumed to be constant.

    The logarithm of the load is normal with unknown mean and variance. The variance has a scaled inverse chi-squared prior.
    """

    def __init__(self, params: RobustParams) -> None:
        """Start without an expected load."""
        self._params = params
        self._mean, self._count, self._squares, self._taught = 0.0, 0, 0.0, math.nan

    @property
    def expected(self) -> tuple[float, float]:
        """Expected `Found.whole` of the next frame and its precision 1/variance; both 0 before the first update."""
        if self._count == 0:
            return UNKNOWN_LOAD
        # s² = (nu s0² + sum of squared deviations) / (nu + n - 1); variance of the next value = s² (1 + 1 / n)
        prior, spread = self._params.load_frames, self._params.load_spread
        variance = (prior * spread**2 + self._squares) / (prior + self._count - 1)
        return self._mean, 1.0 / (variance * (1.0 + 1.0 / self._count))

    def learn(self, found: Found) -> None:
        """Update the estimate with one frame, if the peg has turned since the last update."""
        most = self._params.most_frames
        if abs(math.remainder(found.theta - self._taught, math.pi)) < self._params.turned:
            return
        if self._count == most:
            self._squares *= 1.0 - 1.0 / most
        self._count, self._taught = min(self._count + 1, most), found.theta
        # Running mean and sum of squared deviations (Welford): m += d / n, S += (1 - 1 / n) d², d = x - m
        away = found.whole - self._mean
        self._mean += away / self._count
        self._squares += (1.0 - 1.0 / self._count) * away * away


Prints = Bank | UsualPrints


class Explanation(NamedTuple):
    """One explanation of a frame, with the result of its comparison."""

    against: float
    """Prior log odds against the explanation."""
    found: Found
    bank: Prints
    weights: Vector
    """Weights of the readings under the explanation, shape (2 n,)."""
    is_wide: bool
    """True if all offsets were tried."""
    left: Vector
    """Residuals over their standard deviations, shape (2 n,)."""


class RobustEstimator:
    """Maximum-likelihood estimator that considers faults of a frame; it keeps estimates of the breadth and the load."""

    def __init__(self, params: RobustParams, layout: Layout, peg: Peg) -> None:
        """Make the templates of every explanation."""
        self._params, self._exchanges = params, module_exchanges(layout)
        skin = layout_of(layout)
        self._noise = skin.noise * skin.full_scale
        """Standard deviation of a reading, counts."""
        self._module = module_of(layout).ravel()
        near = tuple(max(peg.overhang + reach, 0.0) for reach in REACHES)
        short = tuple(overhang for overhang in OVERHANGS if overhang < peg.overhang)
        reaching = reaching_templates(layout, peg, params.templates, near + short)
        broad = broad_templates(layout, peg, params.templates, BREADTHS)
        self._usual = UsualPrints(params, broad, reaching.part(0, len(near)))
        steep = params.model_copy(
            update={name: params.steeper * getattr(params, name) for name in ("rise", "common_rise")}
        )
        self._short = Bank(steep, reaching.part(len(near), len(near) + len(short)))
        self._against_short = params.rarity + math.log(max(len(short), 1))
        """Prior log odds against each of the compared lengths of a peg whose back end is between the pads."""
        self._load = Load(params)

    def __copy__(self) -> Self:
        """Return an estimator with the same templates and a copy of the learnt state; the two then learn independently."""
        other = object.__new__(type(self))
        other.__dict__ |= self.__dict__ | {"_usual": copy(self._usual), "_load": copy(self._load)}
        return other

    def estimate(self, frame: TaxelFrame) -> PegPose:
        """Return the pose of the peg in `frame`; see `skills.tactile.pose.Estimator`."""
        params = self._params
        values = frame.values.ravel()
        trusted = self._plausible(frame)
        weights = weights_of(params, self._noise, values, trusted)
        is_loud = (values > params.silent * self._noise) & (weights > 0.0)
        if not is_loud.any():
            return PegPose(0.0, 0.0, math.pi / 2, 1.0, False, frame.stamp)
        bank: Prints = self._usual
        found = bank.compare(values, weights, load=self._load.expected)
        silent = self._silent(is_loud, weights)
        if found.misfit > params.doubt or silent:
            found, bank, weights = self._think_again(values, weights, silent, found)
        seen = TaxelFrame(frame.values, (weights > 0.0).reshape(frame.trusted.shape), frame.stamp, 0)
        pose = pose_of(params, self._noise, found, seen)
        if pose.healthy and pose.sigma <= params.sure:
            self._load.learn(found)
            if bank is self._usual:
                self._usual.learn(found)
        return pose

    def order_odds(self, frame: TaxelFrame) -> Vector:
        """Return the log odds of exchanged modules; see `skills.tactile.order.TellsOrder`."""
        params = self._params
        values, trusted = frame.values.ravel(), self._plausible(frame)
        as_told = self._usual.compare(values, weights_of(params, self._noise, values, trusted))
        odds, found = np.zeros(len(self._exchanges)), [as_told]
        for number, told in enumerate(self._exchanges.values()):
            moved = values[told]
            found.append(self._usual.compare(moved, weights_of(params, self._noise, moved, trusted[told])))
            odds[number] = found[-1].chance - as_told.chance
        if max(each.load for each in found) < params.least_load * self._noise:
            return np.zeros_like(odds)
        # If the noise exceeds the configured noise, all log likelihoods are scaled down by the same factor.
        return odds / max(1.0, min(each.misfit for each in found))

    def _plausible(self, frame: TaxelFrame) -> Mask:
        """Return a mask of the taxels that are trusted and whose readings are not below the baseline, shape (2 n,)."""
        readable: Mask = frame.trusted.ravel() & (frame.values.ravel() > self._params.lowest * self._noise)
        return readable

    def _silent(self, is_loud: Mask, weights: Vector) -> list[int]:
        """Return the indices of the modules that have trusted readings but none above the noise."""
        loud = np.bincount(self._module, is_loud)
        present = np.bincount(self._module, weights > 0.0)
        return [int(module) for module in np.flatnonzero((loud == 0) & (present > 0))]

    def _think_again(
        self, values: Vector, weights: Vector, silent: list[int], usual: Found
    ) -> tuple[Found, Prints, Vector]:
        """Return the likeliest explanation of the frame, its bank, and the weights of the readings that fit it."""
        params, load = self._params, self._load.expected
        tried = [Explanation(0.0, usual, self._usual, weights, False, self._usual.left.copy())]

        def add(against: float, bank: Prints, weights: Vector, is_wide: bool = False) -> None:
            found = bank.compare(values, weights, is_wide, load=load)
            tried.append(Explanation(against, found, bank, weights, is_wide, bank.left.copy()))

        if usual.misfit > params.wide_misfit:
            add(0.0, self._usual, weights, is_wide=True)
        for module in silent:
            without = np.where(module == self._module, 0.0, weights)
            add(params.rarity, self._usual, without)
            add(params.rarity + self._against_short, self._short, without)
        add(self._against_short, self._short, weights)
        # If the noise exceeds the configured noise, all log likelihoods are scaled down by the same factor.
        scale = max(1.0, min(each.found.misfit for each in tried))
        odds = np.array([each.found.chance / scale - each.against for each in tried])
        best = tried[int(odds.argmax())]
        shares = np.exp(odds - odds.max())
        away = np.array([each.found.theta - best.found.theta for each in tried])
        away -= np.pi * np.round(away / np.pi)
        found, left = self._without_outliers(values, best)
        # Other likely explanations widen sigma: sigma² + sum(p_k (theta_k - theta_best)²) / sum(p_k)
        sigma = math.hypot(found.sigma, math.sqrt(shares @ away**2 / shares.sum()))
        return found._replace(sigma=sigma), best.bank, left

    def _without_outliers(self, values: Vector, best: Explanation) -> tuple[Found, Vector]:
        """Leave out readings that do not fit, the worst first, until all fit or `most_outliers` are left out."""
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
