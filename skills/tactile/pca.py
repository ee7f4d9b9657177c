"""Weighted principal axis of the taxels, and a table of its systematic error.

Every taxel counts as much as it reads. The long axis of that cloud of points is the peg's, except that rows of the
lattice pull it towards themselves. A table drawn from templates tells, for every raw axis, where the peg points on
average and how large the remaining error is.
"""

import math
from collections import OrderedDict
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel
from drivers.parts import Peg
from drivers.quantities import FINGERS, TAXELS, Mask, TaxelFrame, Vector
from drivers.skin.layout import Layout, finger_positions
from skills.tactile.plausible import is_print
from skills.tactile.pose import PegPose
from skills.tactile.templates import TemplateParams, make_templates

BINS = 180
"""Number of bins of the raw axis over half a turn."""
DRAWS = 12
"""Number of frames that are drawn for the table at every angle of the templates."""
TABLES = 16
"""Number of tables that are kept, each for one pattern of trusted taxels."""


class PcaParams(ConfigModel):
    """How the axis is found, and what the table is drawn from.

    Source: chosen on simulated pads, its effect measured by `cell study tactile`.
    """

    kind: Literal["pca"] = "pca"
    """The estimator by the principal axis of the readings. Source: docs/tried/angle.md."""
    templates: TemplateParams = TemplateParams(theta_step=math.pi / 180)
    """Model of the pad, as its maker states it."""
    noise: Annotated[float, Field(ge=1.0, le=5000.0)] = 300.0
    """Standard deviation of a taxel's reading, counts."""
    load: Annotated[float, Field(ge=100.0, le=43e3)] = 8500.0
    """Reading of a taxel right under the peg at the usual grip, counts."""
    gain_spread: Annotated[float, Field(ge=0.0, le=0.5)] = 0.06
    """Standard deviation of the taxels' gains, fraction of the reading."""
    offset_spread: Annotated[float, Field(ge=1e-5, le=1e-2)] = 7e-4
    """Standard deviation of the peg's offset from the finger centre, m."""
    imbalance: Annotated[float, Field(ge=0.0, le=0.5)] = 0.15
    """Standard deviation of half the difference of the fingers' loads, fraction of their mean."""
    floor: Annotated[float, Field(ge=0.0, le=10.0)] = 3.0
    """Reading below which a taxel has no weight, standard deviations of the noise."""
    least_peak: Annotated[float, Field(ge=0.0, le=43e3)] = 1500.0
    """Highest taxel below which a frame shows no peg, counts."""
    least_elongation: Annotated[float, Field(ge=1.0, le=100.0)] = 1.5
    """Least ratio of a cloud's axes that has a direction, ratio."""
    most_width: Annotated[float, Field(ge=5e-4, le=2e-2)] = 4.5e-3
    """Largest standard deviation along a cloud's minor axis that is a peg, m."""
    most_sigma: Annotated[float, Field(gt=0.0, le=1.6)] = 0.25
    """Standard deviation of an angle above which theta is not reported, rad."""
    least_trusted: Annotated[int, Field(ge=3, le=FINGERS * TAXELS)] = 20
    """Number of trusted taxels below which a frame tells nothing."""


class PcaEstimator:
    """Principal axis of the taxels, weighted by their readings and corrected by a table.

    A table belongs to one pattern of trusted taxels; it is drawn, always with the same seed, when the pattern is first
    seen.
    """

    def __init__(self, params: PcaParams, layout: Layout, peg: Peg) -> None:
        """Draw the table of a skin whose taxels are all trusted."""
        self._params = params
        self._templates = make_templates(layout, peg, params.templates)
        x, y = finger_positions(layout).reshape(-1, 2).T
        self._powers: Vector = np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])
        self._tables: OrderedDict[bytes, tuple[Vector, Vector]] = OrderedDict()
        self._table(np.ones(FINGERS * TAXELS, dtype=bool))

    def estimate(self, frame: TaxelFrame) -> PegPose:
        """Return the pose of the peg in `frame`; see `skills.tactile.pose.Estimator`."""
        params = self._params
        trusted = frame.trusted.ravel()
        values = np.where(trusted, frame.values.ravel(), 0.0)
        power = float(values @ values)
        if np.count_nonzero(trusted) < params.least_trusted or values.max() < params.least_peak:
            return PegPose(0.0, 0.0, math.pi / 2, 1.0, False, frame.stamp)
        weights = np.where(values > params.floor * params.noise, values, 0.0)
        (raw,), (offset,), (minor,), (major,) = self._axes(weights[None])
        bias, spread = self._table(trusted)
        place = (raw + math.pi / 2) / math.pi * BINS - 0.5
        low, share = math.floor(place), place - math.floor(place)
        theta = raw + (1.0 - share) * bias[low % BINS] + share * bias[(low + 1) % BINS]
        theta = (theta + math.pi / 2) % math.pi - math.pi / 2
        sigma = (1.0 - share) * spread[low % BINS] + share * spread[(low + 1) % BINS]
        left = values[weights == 0.0]
        healthy = (
            major >= params.least_elongation**2 * minor
            and minor <= params.most_width**2
            and sigma <= params.most_sigma
            and is_print(values, trusted)
        )
        return PegPose(theta, offset, float(sigma), float(left @ left) / power, bool(healthy), frame.stamp)

    def _axes(self, weights: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """Return the angle of the long axis, rad, its offset, m, and the variances across and along it, m²; each shape (n,)."""
        mass, *moments = (weights @ self._powers).T
        x, y, xx, xy, yy = (moment / np.maximum(mass, 1e-9) for moment in moments)
        xx, xy, yy = xx - x * x, xy - x * y, yy - y * y
        split = np.hypot(xx - yy, 2.0 * xy)
        theta = 0.5 * np.arctan2(2.0 * xy, xx - yy)
        return theta, np.cos(theta) * y - np.sin(theta) * x, (xx + yy - split) / 2, (xx + yy + split) / 2

    def _table(self, trusted: Mask) -> tuple[Vector, Vector]:
        """Return the correction of a raw axis, and the standard deviation after it, both shape (BINS,), rad."""
        key = trusted.tobytes()
        if key not in self._tables:
            self._tables[key] = self._draw(trusted)
            if len(self._tables) > TABLES:
                self._tables.popitem(last=False)
        return self._tables[key]

    def _draw(self, trusted: Mask) -> tuple[Vector, Vector]:
        params, templates = self._params, self._templates
        rng = np.random.default_rng(0)
        turns, count = templates.theta.size, templates.theta.size * DRAWS
        truth = np.repeat(templates.theta, DRAWS)
        offset = np.clip(rng.normal(0.0, params.offset_spread, count), templates.offset[0], templates.offset[-1])
        place = np.rint((offset - templates.offset[0]) / (templates.offset[1] - templates.offset[0])).astype(int)
        frames = params.load * templates.even[0, np.repeat(np.arange(turns), DRAWS), place]
        half = params.imbalance * rng.standard_normal((count, 1)) * np.repeat([1.0, -1.0], TAXELS)
        frames = frames * (1.0 + half + params.gain_spread * rng.standard_normal(frames.shape))
        frames += params.noise * rng.standard_normal(frames.shape)
        frames[(frames <= params.floor * params.noise) | ~trusted] = 0.0
        raw, _, _, _ = self._axes(frames)
        error = (truth - raw + math.pi / 2) % math.pi - math.pi / 2
        bin_of = np.floor((raw + math.pi / 2) / math.pi * BINS).astype(int) % BINS
        # Smoothing over neighbouring bins leaves none empty and takes out jumps.
        kernel = np.exp(-0.5 * (np.arange(-6, 7) / 1.0) ** 2)

        def gathered(values: Vector) -> Vector:
            sums = np.bincount(bin_of, values, BINS)
            wrapped = np.concatenate([sums[-6:], sums, sums[:6]])
            return np.convolve(wrapped, kernel, mode="valid")

        seen = np.maximum(gathered(np.ones(count)), 1e-9)
        bias = gathered(error) / seen
        spread = np.sqrt(np.maximum(gathered(error**2) / seen - bias**2, 0.0))
        return bias, np.where(seen > 1.0, spread, math.pi / 2)
