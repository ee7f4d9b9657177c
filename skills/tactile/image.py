"""The tactile image of [gibbons], Sec. III: taxels to one image of both fingers, its ellipse to theta and offset."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel
from drivers.parts import Fraction
from drivers.quantities import FINGERS, TAXELS, Mask, TaxelFrame, Vector
from drivers.skin.layout import PITCH, Layout, finger_positions, triangles
from skills.tactile.plausible import is_print
from skills.tactile.pose import PegPose

LATTICE_ERROR: dict[Layout, float] = {"parallelogram": 3.2e-6, "base_to_base": 4.9e-6}
"""RMS error that the coarse lattice leaves in the image's second moments, m²; see `ImageEstimator`."""


class ImageParams(ConfigModel):
    """How the image is made and read."""

    kind: Literal["image"] = "image"
    pixel: Annotated[float, Field(ge=1e-4, le=5e-3)] = 1e-3
    """Side of a pixel, m."""
    full_scale: Annotated[float, Field(ge=100.0, le=1e6)] = 20e3
    """Counts at which a pixel is saturated, [gibbons], Eq. (1)."""
    threshold: Fraction = 0.5
    """Pixels below this share of the brightest are background."""
    least_peak: Annotated[float, Field(ge=0.0, le=43e3)] = 2000.0
    """A frame whose highest pixel is below this shows no peg, counts."""
    least_elongation: Annotated[float, Field(ge=1.0, le=100.0)] = 1.5
    """An ellipse whose axes' ratio is below this has no direction."""
    most_width: Annotated[float, Field(ge=5e-4, le=2e-2)] = 4e-3
    """An ellipse whose minor axis has a larger standard deviation is no peg, m; 2.4 mm for 8 mm of diameter."""
    most_residual: Fraction = 0.4
    """A frame with more than this beside the peg's axis shows something else."""
    least_trusted: Annotated[int, Field(ge=3, le=FINGERS * TAXELS)] = 20
    """Fewer trusted taxels than this tell nothing."""


class ImageEstimator:
    """Image moments of the thresholded sum of both fingers' images, the method of [gibbons].

    Each pixel of a finger's image is interpolated linearly between the corners of its Delaunay triangle;
    outside all triangles it is 0. The left image is flipped ([gibbons], Eq. (1)) by taking its taxels where
    they are in the finger frame. Pixels keep their grey value above the threshold.

    Where taxels are not trusted, a pixel is made from what remains of its corners in both images, scaled to
    the whole, as long as a quarter of the weights remains; a dead module is so replaced by the other finger.

    The error of theta is mostly the lattice's and not noise. An error e of the second moments turns the
    ellipse by e / (l1 - l2), with its squared axes l1, l2 (first order of the moments' formula); sigma is that for
    `LATTICE_ERROR`, more by the share of taxels that are missing.
    """

    def __init__(self, params: ImageParams, layout: Layout) -> None:
        """Lay the pixel grid over the taxels of `layout`."""
        self._params = params
        self._lattice_error = LATTICE_ERROR[layout]
        self._taxels: Vector = finger_positions(layout).reshape(-1, 2)
        pixels, weights = interpolation(layout, params.pixel)
        self._shape = pixels.shape[:2]
        self._covered: Mask = weights.any(axis=(2, 3)).ravel()
        self._weights: Vector = weights.reshape(-1, FINGERS * TAXELS)[self._covered]
        self._whole: Vector = self._weights.sum(axis=1)
        x, y = pixels.reshape(-1, 2)[self._covered].T
        self._powers: Vector = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])

    def image(self, frame: TaxelFrame) -> Vector:
        """Return I of [gibbons], Eq. (1), before the threshold, counts; rows along y, columns along x, both rising."""
        whole = np.zeros(self._covered.size)
        whole[self._covered] = self._pixels(frame)
        return whole.reshape(self._shape)

    def estimate(self, frame: TaxelFrame) -> PegPose:
        """Return the pose of the peg in `frame`; see `skills.tactile.pose.Estimator`."""
        params = self._params
        pixels = self._pixels(frame)
        peak = float(pixels.max())
        trusted = int(np.count_nonzero(frame.trusted))
        if peak < params.least_peak or peak <= 0.0 or trusted < params.least_trusted:
            return PegPose(0.0, 0.0, math.pi / 2, 1.0, False, frame.stamp)
        pixels[pixels < params.threshold * peak] = 0.0
        mass, *moments = (self._powers @ pixels).tolist()
        x, y, xx, xy, yy = (moment / mass for moment in moments)
        xx, xy, yy = xx - x * x, xy - x * y, yy - y * y
        split = math.hypot(xx - yy, 2.0 * xy)
        theta = 0.5 * math.atan2(2.0 * xy, xx - yy)
        if theta >= math.pi / 2:
            theta -= math.pi
        c, s = math.cos(theta), math.sin(theta)
        offset = c * y - s * x
        residual = self._beside(frame, c, s, offset)
        minor, major = (xx + yy - split) / 2, (xx + yy + split) / 2
        is_line = major >= params.least_elongation**2 * minor and minor <= params.most_width**2
        return PegPose(
            theta=theta,
            offset=offset,
            sigma=self._sigma(split, trusted),
            residual=residual,
            healthy=is_line and residual <= params.most_residual and is_print(frame.values, frame.trusted),
            stamp=frame.stamp,
        )

    def _pixels(self, frame: TaxelFrame) -> Vector:
        values = frame.values.ravel()
        if frame.trusted.all():
            total: Vector = self._weights @ values
        else:
            known = frame.trusted.ravel().astype(float)
            share = self._weights @ known / self._whole
            total = self._weights @ (values * known)
            total *= (share >= 0.25) / np.maximum(share, 0.25)
        np.clip(total, 0.0, self._params.full_scale, out=total)
        return total

    def _beside(self, frame: TaxelFrame, c: float, s: float, offset: float) -> float:
        """Return the share of the positive counts that lies more than a pitch beside the axis."""
        pressed = np.maximum(frame.values.ravel(), 0.0) * frame.trusted.ravel()
        beside = np.abs(self._taxels @ np.array([-s, c]) - offset) > PITCH
        return float(pressed @ beside / pressed.sum())

    def _sigma(self, split: float, trusted: int) -> float:
        """Return the standard deviation of theta, rad, at most that of no knowledge at all (pi/2)."""
        error = self._lattice_error * FINGERS * TAXELS / trusted
        return min(error / split, math.pi / 2) if split > 0.0 else math.pi / 2


def interpolation(layout: Layout, pixel: float) -> tuple[Vector, Vector]:
    """Return the pixels of an image and how each follows from the taxels, by linear interpolation.

    Args:
        layout: Where the taxels are.
        pixel: Side of a pixel, m.

    Returns:
        Centres of the pixels in the finger frame, shape (rows, columns, 2), m, rows along y; and weights,
        shape (rows, columns, 2, 20), of which each finger's add up to 1 inside its taxels and are 0 outside.
    """
    taxels = finger_positions(layout)
    columns, rows = np.ceil(np.abs(taxels).max(axis=(0, 1)) / pixel - 1e-9).astype(int)
    centres = np.stack(np.meshgrid(np.arange(-columns, columns + 1), np.arange(-rows, rows + 1)), axis=-1) * pixel
    weights = np.zeros((*centres.shape[:2], FINGERS, TAXELS))
    for finger in range(FINGERS):
        for corners in triangles(layout):
            a, b, c = taxels[finger, corners]
            # Barycentric coordinates: centre - a = v (b - a) + w (c - a).
            v, w = np.moveaxis((centres - a) @ np.linalg.inv(np.array([b - a, c - a])), -1, 0)
            inside = np.minimum(np.minimum(v, w), 1.0 - v - w) >= -1e-9
            weights[inside, finger] = 0.0
            weights[inside, finger, corners[0]] = (1.0 - v - w)[inside]
            weights[inside, finger, corners[1]] = v[inside]
            weights[inside, finger, corners[2]] = w[inside]
    return centres, weights
