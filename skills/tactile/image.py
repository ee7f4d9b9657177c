"""Theta and offset from the tactile image of [gibbons], Sec. III: one image of both fingers, and its ellipse."""

import math
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel, Figure, Quantity
from drivers.errors import ConfigError
from drivers.parts import Fraction
from drivers.quantities import Mask, TaxelFrame, Vector
from drivers.skin.layout import PITCH, Layout, finger_positions, layout_of
from skills.tactile.pose import PegPose

LATTICE_ERROR: dict[Layout, float] = {"parallelogram": 3.2e-6, "base_to_base": 4.9e-6}
"""RMS error of the image's second moments from the coarse lattice of taxels, m²; see `ImageEstimator`."""


class ImageParams(ConfigModel):
    """Parameters of the tactile image and of its ellipse."""

    SOURCE: ClassVar[str] = "chosen on simulated pads, its effect measured by `cell study tactile`"

    pixel: Annotated[float, Figure("m"), Field(exclude=True)] = 1e-3
    """Side of a pixel, m."""
    threshold: Annotated[Fraction, Quantity("fraction")] = 0.5
    """Brightness below which a pixel is background, fraction of the brightest."""
    least_peak: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.1
    """Least brightness of the brightest pixel in a frame that shows a peg, fraction of the skin's full scale; a pixel saturates at full scale."""
    least_elongation: Annotated[float, Figure("ratio"), Field(exclude=True)] = 1.5
    """Least ratio of the ellipse's axes, ratio; below it the direction of the ellipse is not used."""
    most_width: Annotated[float, Figure("m"), Field(exclude=True)] = 4e-3
    """Largest standard deviation along the minor axis of a peg's ellipse, m; 2.4 mm for a diameter of 8 mm."""
    most_residual: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.4
    """Largest share of the image away from the peg's axis if the frame shows a peg, fraction."""
    least_trusted: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.5
    """Least share of trusted taxels for an estimate, fraction."""
    most_below: Annotated[float, Figure("fraction"), Field(exclude=True)] = 0.25
    """Largest share of readings below the baseline in the sum of squares of a frame that shows a peg, fraction; noise alone gives one half."""
    least_pressed: Annotated[float, Figure("count"), Field(exclude=True)] = 3.0
    """Least effective number of taxels pressed by a peg, (sum y)² / sum y²."""

    def is_print(self, values: Vector, trusted: Mask) -> bool:
        """Return True if the readings, counts, can come from a peg between the pads."""
        # sum of y² over y < 0 <= most_below · sum of y², and (sum y)² / sum y² >= least_pressed over y > 0
        known = np.where(trusted, values, 0.0)
        pressed = np.maximum(known, 0.0)
        squares = float(np.vdot(pressed, pressed))
        below = float(np.vdot(known, known)) - squares
        is_pressed = pressed.sum() ** 2 >= self.least_pressed * squares
        return squares > 0.0 and below <= self.most_below * (squares + below) and is_pressed


class ImageEstimator:
    """Estimator by image moments of the thresholded sum of both fingers' images, the method of [gibbons].

    `skills.tactile.picture` makes the image and handles untrusted taxels. The flip of the left image ([gibbons],
    Eq. (1)) follows from the taxels' positions in the finger frame. If a module is dead, the module of the other
    finger replaces it.

    The coarse lattice, not noise, causes most of the error of theta. An error e of the second moments turns the ellipse
    by e / (l1 - l2), to first order, where l1 and l2 are the squared axes. Sigma is this value for e = `LATTICE_ERROR`,
    scaled by the ratio of all taxels to trusted taxels.
    """

    def __init__(self, params: ImageParams, layout: Layout) -> None:
        """Prepare the pixel grid over the taxels of `layout`.

        Raises:
            ConfigError: The error of this lattice is not known.
        """
        from skills.tactile.picture import Projector  # OpenCV takes 0.2 s to import

        self._params = params
        if layout not in LATTICE_ERROR:
            raise ConfigError(
                f'skin.layout = "{layout}": not for the estimator image; insert.estimator = "robust" allowed'
            )
        self._lattice_error = LATTICE_ERROR[layout]
        self._taxels: Vector = finger_positions(layout).reshape(-1, 2)
        full_scale = layout_of(layout).full_scale
        self._projector, self._least_peak = Projector(layout, params.pixel, full_scale), params.least_peak * full_scale

    def estimate(self, frame: TaxelFrame) -> PegPose:
        """Return the pose of the peg in `frame`; see `skills.tactile.pose.Estimator`."""
        params = self._params
        image = self._projector.image(frame.values, frame.trusted)
        peak = float(image.max())
        trusted = int(np.count_nonzero(frame.trusted))
        if peak < self._least_peak or peak <= 0.0 or trusted < params.least_trusted * frame.trusted.size:
            return PegPose(0.0, 0.0, math.pi / 2, 1.0, False, frame.stamp)
        ellipse = self._projector.ellipse(image, params.threshold * peak)
        # Signed distance of the axis from the finger centre: offset = y cos(theta) - x sin(theta)
        c, s = math.cos(ellipse.theta), math.sin(ellipse.theta)
        offset = c * ellipse.y - s * ellipse.x
        residual = self._beside(frame, c, s, offset)
        is_line = ellipse.major >= params.least_elongation**2 * ellipse.minor and ellipse.minor <= params.most_width**2
        return PegPose(
            theta=ellipse.theta,
            offset=offset,
            sigma=self._sigma(ellipse.major - ellipse.minor, trusted),
            residual=residual,
            healthy=is_line and residual <= params.most_residual and params.is_print(frame.values, frame.trusted),
            stamp=frame.stamp,
        )

    def _beside(self, frame: TaxelFrame, c: float, s: float, offset: float) -> float:
        """Return the share of the positive counts at more than one taxel pitch from the axis."""
        pressed = np.maximum(frame.values.ravel(), 0.0) * frame.trusted.ravel()
        beside = np.abs(self._taxels @ np.array([-s, c]) - offset) > PITCH
        return float(pressed @ beside / pressed.sum())

    def _sigma(self, split: float, trusted: int) -> float:
        """Return the standard deviation of theta, rad, at most pi/2 (theta unknown)."""
        # sigma = e / (l1 - l2), e = LATTICE_ERROR · all / trusted
        error = self._lattice_error * len(self._taxels) / trusted
        return min(error / split, math.pi / 2) if split > 0.0 else math.pi / 2
