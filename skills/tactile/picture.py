"""Tactile image and its ellipse, computed with OpenCV; only modules that need images import it."""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.quantities import FINGERS, Mask, Vector
from drivers.skin.layout import Layout, finger_positions, triangles

Image = NDArray[np.integer[Any] | np.floating[Any]]
"""Image, counts, single precision; the resolution is a thousandth of a count."""
LEAST_KNOWN = 0.25
"""Least share of trusted taxels in the interpolation weights of a pixel, fraction; below it the pixel is black."""
PRECISION = 1e-6
"""Relative precision of single-precision values; smaller differences count as zero."""


@dataclass(frozen=True, slots=True)
class Ellipse:
    """Ellipse with the second moments of an image."""

    x: float
    """Centre along x, m, finger frame."""
    y: float
    """Centre along y, m, finger frame."""
    theta: float
    """Angle from x to the long axis, rad, in [-pi/2, pi/2)."""
    major: float
    """Variance along the long axis, m²."""
    minor: float
    """Variance along the short axis, m²."""


class Projector:
    """Projection of frames onto a grid of pixels, rows along +y and columns along +x, centred on the finger centre.

    Each pixel of a finger's image is interpolated linearly between the corners a, b, c of its Delaunay triangle.
    Pixels outside all triangles are black. `cv2.remap` interpolates bilinearly, which is linear on the square
    a, b, c, b + c - a. The source image therefore holds one such square of 2 x 2 pixels for each triangle, and each
    pixel is sampled from the square of its triangle.
    """

    def __init__(self, layout: Layout, pixel: float, full_scale: float) -> None:
        """Prepare pixels of side `pixel`, m, over the taxels of `layout`; pixels saturate at `full_scale`, counts."""
        taxels, corners = finger_positions(layout), triangles(layout)
        columns, rows = np.ceil(np.abs(taxels).max(axis=(0, 1)) / pixel - 1e-9).astype(int)
        x, y = np.meshgrid(np.arange(-columns, columns + 1), np.arange(-rows, rows + 1))
        self.centres: Vector = np.stack([x, y], axis=-1) * pixel
        """Centres of the pixels, shape (rows, columns, 2), m, finger frame."""
        self._pixel, self._middle, self._full_scale = pixel, (columns, rows), full_scale
        # Both fingers share one source and one destination image, with the right finger below the left.
        a, b, c = np.eye(taxels[..., 0].size, dtype=np.float32)[
            np.concatenate([corners + taxels.shape[1] * finger for finger in range(FINGERS)]).T
        ]
        self._squares = np.stack([np.stack([a, b], axis=1), np.stack([c, b + c - a], axis=1)]).reshape(-1, a.shape[1])
        across, along = np.full((2, FINGERS, *x.shape), -2.0, dtype=np.float32)
        for finger in range(FINGERS):
            for number, (at_a, at_b, at_c) in enumerate(taxels[finger, corners]):
                # Barycentric coordinates: centre - a = v (b - a) + w (c - a).
                v, w = np.moveaxis((self.centres - at_a) @ np.linalg.inv(np.array([at_b - at_a, at_c - at_a])), -1, 0)
                inside = np.minimum(np.minimum(v, w), 1.0 - v - w) >= -1e-9
                square = 2 * (finger * len(corners) + number)
                across[finger, inside], along[finger, inside] = (square + v)[inside], w[inside]
        self._where = across.reshape(-1, x.shape[1]), along.reshape(-1, x.shape[1])
        self._pattern = b""
        self._scale: Image = np.zeros(x.shape, dtype=np.float32)

    def image(self, values: Vector, trusted: Mask) -> Image:
        """Return the saturated sum of both fingers' images, [gibbons], Eq. (1), counts, shape (rows, columns).

        If a taxel at a corner of a pixel is not trusted, the pixel's other corners in both images are scaled up instead.

        Args:
            values: Readings, counts, shape (2, n).
            trusted: Mask of the readings to use, shape (2, n).
        """
        if trusted.all():
            total = cv2.add(*self._drawn(values))
        else:
            if trusted.tobytes() != self._pattern:
                self._pattern, self._scale = trusted.tobytes(), self._scale_of(trusted)
            total = cv2.multiply(cv2.add(*self._drawn(np.where(trusted, values, 0.0))), self._scale)
        return np.asarray(cv2.threshold(total, self._full_scale, 0.0, cv2.THRESH_TRUNC)[1])

    def ellipse(self, image: Image, threshold: float) -> Ellipse:
        """Return the ellipse of the pixels with a brightness of at least `threshold`, counts, >= 0.

        Pixels keep their grey value. Moments and axes follow [gibbons], Sec. III.
        """
        _, bright = cv2.threshold(image, threshold * (1.0 - PRECISION), 0.0, cv2.THRESH_TOZERO)
        moments = cv2.moments(bright)
        mass, area = moments["m00"], self._pixel**2
        # theta = 1/2 atan2(2 mu11, mu20 - mu02);
        # variances along the axes = (mu20 + mu02 ± sqrt((mu20 - mu02)² + 4 mu11²)) / 2
        xx, xy, yy = (moments[name] / mass * area for name in ("mu20", "mu11", "mu02"))
        split = math.hypot(xx - yy, 2.0 * xy)
        theta = 0.5 * math.atan2(2.0 * xy, xx - yy)
        return Ellipse(
            x=(moments["m10"] / mass - self._middle[0]) * self._pixel,
            y=(moments["m01"] / mass - self._middle[1]) * self._pixel,
            theta=theta - math.pi if theta >= math.pi / 2 else theta,
            major=(xx + yy + split) / 2,
            minor=(xx + yy - split) / 2,
        )

    def _drawn(self, values: Vector) -> tuple[Image, Image]:
        """Return the images of both fingers, each of shape (rows, columns)."""
        squares = (self._squares @ values.ravel().astype(np.float32)).reshape(2, -1)
        drawn = cv2.remap(squares, *self._where, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        rows = len(self.centres)
        return drawn[:rows], drawn[rows:]

    def _scale_of(self, trusted: Mask) -> Image:
        """Return the factor on each pixel that compensates for untrusted taxels, shape (rows, columns)."""
        known = np.add(*self._drawn(trusted.astype(float)))
        whole = np.add(*self._drawn(np.ones(trusted.shape)))
        share = known / np.maximum(whole, 0.5)
        scale = (share >= LEAST_KNOWN * (1.0 - PRECISION)) / np.maximum(share, LEAST_KNOWN)
        return np.asarray(scale, dtype=np.float32)
