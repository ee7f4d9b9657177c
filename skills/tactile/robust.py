"""Maximum likelihood that also considers what may be wrong with a frame, once it is further off than noise explains.

What may be wrong: a module that died unnoticed, the peg far off centre or with its end between the pads, a point
spread other than the one believed, single taxels that read anything. Each is a template bank or a mask of its own; the
likeliest wins, and readings that still do not fit are left out.
"""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from drivers.parts import Peg
from drivers.quantities import Mask, TaxelFrame, Vector
from drivers.skin_layout import MODULE_OF, Layout
from skills.contract import PegPose
from skills.tactile.likelihood import Bank, Found, LikelihoodParams, pose_of, weights_of
from skills.tactile.templates import make_templates

BELOW = -6.0
"""A reading so many standard deviations below its baseline is no pressure."""
SILENT = 4.0
"""A module none of whose readings exceeds so many standard deviations may be dead."""
MEDIAN_OF_NORMAL = 0.6745
_MODULE = MODULE_OF.ravel()
MODULES = 4


class RobustParams(LikelihoodParams):
    """As for maximum likelihood, and how much of what else to consider."""

    kind: Literal["ml", "robust"] = "robust"
    doubt: Annotated[float, Field(ge=1.0, le=100.0)] = 2.2
    """Beyond this misfit everything that may be wrong is considered."""
    rarity: Annotated[float, Field(ge=0.0, le=30.0)] = 5.0
    """Log of the odds against each of those."""
    blurs: tuple[Annotated[float, Field(gt=0.2, lt=5.0)], ...] = (0.75, 1.35)
    """Point spreads that the pad may have instead, multiples of the one believed."""
    overhangs: tuple[Annotated[float, Field(ge=-0.05, le=0.05)], ...] = (8e-3, 4e-3, 0.0, -4e-3)
    """How far the peg may reach beyond the finger centre instead of as far as it should, m."""
    outlier: Annotated[float, Field(ge=2.0, le=20.0)] = 4.0
    """A reading so many standard deviations off the rest is left out."""
    most_outliers: Annotated[int, Field(ge=0, le=20)] = 4
    """So many at the most."""


class RobustEstimator:
    """Maximum likelihood with second thoughts; a frame that fits at once costs no more than without."""

    def __init__(self, params: RobustParams, layout: Layout, peg: Peg) -> None:
        """Make the templates of everything that is considered."""
        self._params = params
        self._usual = Bank(params, make_templates(layout, peg, params.templates))
        blurred = [params.templates.model_copy(update={"blur": f * params.templates.blur}) for f in params.blurs]
        short = [peg.model_copy(update={"overhang": reach}) for reach in params.overhangs if reach < peg.overhang]
        self._others = [Bank(params, make_templates(layout, peg, each)) for each in blurred]
        self._others += [Bank(params, make_templates(layout, each, params.templates)) for each in short]

    def estimate(self, frame: TaxelFrame) -> PegPose:
        """Return the pose of the peg in `frame`; see `skills.contract.Estimator`."""
        params = self._params
        values = frame.values.ravel()
        trusted = frame.trusted.ravel() & (values > BELOW * params.noise)
        weights = weights_of(params, values, trusted)
        is_loud = (values > SILENT * params.noise) & (weights > 0.0)
        if not is_loud.any():
            return PegPose(0.0, 0.0, math.pi / 2, 1.0, False, frame.stamp)
        found, bank = self._usual.compare(values, weights), self._usual
        silent = self._silent(is_loud, weights)
        if found.misfit > params.doubt or silent:
            found, bank, weights = self._think_again(values, weights, silent, found)
            found, weights = self._without_outliers(values, weights, found, bank)
        return pose_of(
            params, found, TaxelFrame(frame.values, (weights > 0.0).reshape(frame.trusted.shape), frame.stamp, 0)
        )

    def _silent(self, is_loud: Mask, weights: Vector) -> list[int]:
        """Return the modules that show nothing."""
        loud = np.bincount(_MODULE, is_loud, MODULES)
        present = np.bincount(_MODULE, weights > 0.0, MODULES)
        return [int(module) for module in np.flatnonzero((loud == 0) & (present > 0))]

    def _think_again(
        self, values: Vector, weights: Vector, silent: list[int], usual: Found
    ) -> tuple[Found, Bank, Vector]:
        """Return the likeliest explanation, its bank and the weights that it leaves."""
        tried = [(0.0, usual, self._usual, weights)]
        if usual.misfit > self._params.wide_misfit:
            tried.append((0.0, self._usual.compare(values, weights, True), self._usual, weights))
        for module in silent:
            without = np.where(module == _MODULE, 0.0, weights)
            tried.append((self._params.rarity, self._usual.compare(values, without), self._usual, without))
        least = min(found.misfit for _, found, _, _ in tried)
        if least > self._params.doubt:
            for bank in self._others:
                tried.append((self._params.rarity, bank.compare(values, weights), bank, weights))
        # Noise may be stronger than believed: then all log likelihoods shrink.
        scale = max(1.0, min(found.misfit for _, found, _, _ in tried))
        _, found, bank, left = max(tried, key=lambda each: each[1].chance / scale - each[0])
        return found, bank, left

    def _without_outliers(self, values: Vector, weights: Vector, found: Found, bank: Bank) -> tuple[Found, Vector]:
        """Leave out readings that stand apart, the worst first, as long as there are any."""
        found = bank.compare(values, weights, True)
        for _ in range(self._params.most_outliers):
            away = np.abs(bank.left)
            usual = max(1.0, float(np.median(away[weights > 0.0])) / MEDIAN_OF_NORMAL) if weights.any() else math.inf
            worst = int(away.argmax())
            if away[worst] < self._params.outlier * usual:
                break
            weights = np.where(np.arange(weights.size) == worst, 0.0, weights)
            found = bank.compare(values, weights, True)
        return found, weights
