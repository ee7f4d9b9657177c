"""Maximum likelihood over templates: comparison of a frame with predicted frames of all angles and offsets.

Each finger's load is a constant plus a part that rises along the peg. A frame is linear in these four amounts. Their
priors are Gaussian and expect equal mean loads on both fingers and opposite rises. The loads are therefore integrated out
exactly for every angle and offset. The estimate is the mean and spread of the remaining posterior of angle and offset.
The print of a peg is its trace of pressure on the taxels.
"""

import math
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel, Figure, Source
from drivers.quantities import Mask, TaxelFrame, Vector
from skills.tactile.pose import PegPose
from skills.tactile.templates import TemplateParams, Templates


class RobustParams(ConfigModel):
    """Model of an expected frame, prior of a frame's faults, and limits beyond which a frame shows no peg."""

    SOURCE: ClassVar[str] = "chosen on simulated pads, its effect measured by `cell study tactile`"

    templates: TemplateParams = TemplateParams()
    """Model of the pad, from the maker's data."""
    gain_spread: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.08
    """Standard deviation of a taxel's gain and of the template error, fraction of the reading."""
    offset_spread: Annotated[float, Figure("m"), Field(exclude=True)] = 7e-4
    """Standard deviation of the peg's offset from the finger centre, m."""
    off_centre: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.05
    """Prior probability that the offset is uniformly distributed over the templates' reach, fraction."""
    imbalance: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.3
    """Standard deviation of half the difference of the fingers' loads, fraction of their mean."""
    rise: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.6
    """Standard deviation of the loads' opposite rise over 20 mm, fraction of their mean."""
    common_rise: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.1
    """Standard deviation of the rise over 20 mm that both loads share, fraction of their mean."""
    wide_misfit: Annotated[float, Figure("ratio"), Field(exclude=True)] = 3.0
    """Misfit above which all offsets are searched, ratio of squared residuals to those expected."""
    least_load: Annotated[float, Figure("standard deviations"), Field(exclude=True)] = 5.0
    """Least mean load of a held peg, as the reading directly under the peg, standard deviations of a reading's noise."""
    most_sigma: Annotated[float, Figure("rad"), Field(exclude=True)] = 0.1
    """Largest standard deviation of theta in a healthy estimate, rad."""
    most_misfit: Annotated[float, Figure("ratio"), Field(exclude=True)] = 12.0
    """Misfit above which the frame does not show a peg, ratio of squared residuals to those expected."""
    most_residual: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.3
    """Largest share of a frame's sum of squares that the template may leave unexplained, fraction. A larger share is accepted if the misfit is at
    most `wide_misfit`, because noise then explains the rest, for example under a weak grip.
    """
    least_trusted: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.5
    """Least share of trusted taxels for an estimate, fraction."""
    doubt: Annotated[float, Figure("ratio"), Field(exclude=True)] = 2.2
    """Misfit above which faults of a frame are considered, ratio of squared residuals to those expected."""
    rarity: Annotated[float, Figure("ratio"), Field(exclude=True)] = 5.0
    """Natural logarithm of the odds against each fault of a frame, ratio."""
    outlier: Annotated[float, Figure("standard deviations"), Field(exclude=True)] = 4.0
    """Residual at which a reading is left out as an outlier, standard deviations."""
    most_outliers: Annotated[int, Figure("count"), Field(exclude=True)] = 4
    """Largest number of readings to leave out."""
    reach_spread: Annotated[float, Figure("m"), Field(exclude=True), Source("docs/tried/angle.md")] = 1e-3
    """Standard deviation of the peg's overhang (its length inside the hand, beyond the finger centre) about the stated one, m."""
    lowest: Annotated[float, Figure("standard deviations"), Field(exclude=True)] = -6.0
    """Reading below which a taxel is faulty, standard deviations; no pressure lowers a reading below its baseline."""
    silent: Annotated[float, Figure("standard deviations"), Field(exclude=True)] = 4.0
    """Largest reading of a possibly dead module, standard deviations of the noise."""
    most_surety: Annotated[float, Figure("1/variance"), Field(exclude=True)] = 20.0
    """Largest precision of the estimated breadth of the print, 1/variance of its index in `robust.BREADTHS`: 4 % of breadth. The precision is
    bounded because the breadth changes with the load.
    """
    turned: Annotated[float, Figure("rad"), Field(exclude=True), Source("chosen, not measured")] = math.radians(5.0)
    """Least rotation of the peg between two updates of the estimates, rad; frames at the same angle have the same errors."""
    sure: Annotated[float, Figure("rad"), Field(exclude=True), Source("docs/tried/angle.md")] = math.radians(1.5)
    """Largest sigma of a frame that updates the estimates of breadth and load, rad. If two angles give similar frames, an update from
    the wrong angle makes the next frame prefer the wrong angle, too.
    """
    learning: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.5
    """Share of a frame's information on the breadth used for an update, fraction; it allows for template errors."""
    load_spread: Annotated[float, Figure("ratio"), Field(exclude=True)] = 0.15
    """Prior standard deviation of the logarithm of a pad's load, ratio."""
    load_frames: Annotated[int, Figure("count"), Field(exclude=True)] = 4
    """Weight of the prior `load_spread`, number of frames."""
    most_frames: Annotated[int, Figure("count"), Field(exclude=True)] = 20
    """Largest weight of the load estimate, number of frames; the estimate adapts to a changed grip in about as many frames."""
    steeper: Annotated[float, Figure("ratio"), Field(exclude=True)] = 3.5
    """Factor on the rise of the loads along a short peg, ratio: a short peg bears the same moment on 23 mm of the pads instead of 35 mm,
    (35/23)³.
    """


class Found(NamedTuple):
    """Result of the comparison of one frame with the templates."""

    theta: float
    """In-hand angle, rad."""
    offset: float
    """Signed distance of the peg's axis from the finger centre, m."""
    sigma: float
    """Standard deviation of theta, rad."""
    load: float
    """Mean load of both fingers, as the reading directly under the peg, counts."""
    misfit: float
    """Sum of squared residuals over its expected value, ratio."""
    residual: float
    """Share of the frame's squares not explained by the template, fraction."""
    chance: float
    """Log posterior of the likeliest angle, up to a constant that depends on frame and weights."""
    place: float
    """Index of the likeliest print in the bank, 0 for the first; interpolated between two prints."""
    surety: float
    """Precision of `place`, 1/variance, including the prior."""
    whole: float
    """Logarithm of the load of one pad, mean of both fingers, integrated along the peg's contact, counts·m."""


UNKNOWN_LOAD = (0.0, 0.0)
"""Expected `Found.whole` and its precision 1/variance if the load is unknown: precision 0."""


class Bank:
    """Templates of one peg, for one print or several, prepared for comparison with frames."""

    def __init__(self, params: RobustParams, templates: Templates) -> None:
        """Prepare the tables of a comparison for one print, or for at least three prints at even steps."""
        # Prior of the offset d: p(d) = (1 - q) N(d; 0, offset_spread) + q / (2 offset_reach), q = off_centre,
        # times a constant; `prior` is -ln(p / max p).
        within = np.exp(-0.5 * (templates.offset / params.offset_spread) ** 2) / params.offset_spread
        anywhere = math.sqrt(2.0 * math.pi) / (2.0 * params.templates.offset_reach)
        chance = (1.0 - params.off_centre) * within + params.off_centre * anywhere
        prior: Vector = -np.log(chance / chance.max())
        tightness: Vector = np.array([params.imbalance, params.common_rise, params.rise]) ** -2.0
        self._middle = (float(len(templates.even) // 2), 0.0)
        self._arguments = (prior, tightness, templates.theta, templates.offset, templates.even, templates.rising)
        self._places = (templates.along, templates.borne)
        self._coarse = templates.coarse
        self.left: Vector = np.zeros(templates.along.shape[1])
        """Residuals of the last comparison over their standard deviations, shape (2 n,)."""
        # The first call compiles the comparison or loads it from the cache; it must not happen during a scan.
        self.compare(np.ones(self.left.size), np.ones(self.left.size))

    def compare(
        self,
        values: Vector,
        weights: Vector,
        is_wide: bool = False,
        believed: tuple[float, float] | None = None,
        load: tuple[float, float] = UNKNOWN_LOAD,
    ) -> Found:
        """Compare a frame with the templates of all angles.

        Args:
            values: Readings, counts, shape (2 n,).
            weights: Inverse of the readings' expected variance, 0 if not trusted, shape (2 n,).
            is_wide: True to try all offsets, False to try those near the finger centre.
            believed: Expected print, as place and precision of `Found`; None if unknown.
            load: Expected load, as `Found.whole` and its precision 1/variance.
        """
        from skills.tactile.posterior import posterior  # imports the compiler, which only a comparison needs

        expected = believed or self._middle
        arguments = (*self._arguments, *self._places, self._coarse, load, self.left)
        return Found(*posterior(is_wide, *expected, values, weights, *arguments))


def weights_of(params: RobustParams, noise: float, values: Vector, trusted: Mask) -> Vector:
    """Return the inverse of each reading's expected variance, shape (2 n,), 0 if the taxel is not trusted.

    `noise` is the standard deviation of a reading, counts.
    """
    # w = 1 / (noise² + (gain_spread · max(y, 0))²)
    expected = params.gain_spread * np.maximum(values, 0.0)
    weights: Vector = trusted / (noise**2 + expected * expected)
    return weights


def pose_of(params: RobustParams, noise: float, found: Found, frame: TaxelFrame) -> PegPose:
    """Return the result of a comparison as a pose; `healthy` is True if it meets all limits of `params`."""
    healthy = (
        found.load >= params.least_load * noise
        and found.sigma <= params.most_sigma
        and found.misfit <= params.most_misfit
        and (found.residual <= params.most_residual or found.misfit <= params.wide_misfit)
        and np.count_nonzero(frame.trusted) >= params.least_trusted * frame.trusted.size
    )
    sigma = min(found.sigma, math.pi / 2)
    return PegPose(found.theta, found.offset, sigma, found.residual, bool(healthy), frame.stamp)
