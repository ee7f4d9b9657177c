"""Where a course leads the peg over the area."""

import math

import numpy as np
import pytest

from skills.search.course import leading

RIM = np.linspace(-math.pi, math.pi, 2001)
"""Angles about the axis of the peg's end, from its lowest point, rad."""
ALONG = np.linspace(-3e-3, 3e-3, 61)
"""Places along a lane, from the hole's middle, m."""


def falls(edge: float, tilt: float, depth: float, peg: float = 4e-3, hole: float = 4.05e-3) -> bool:
    """Return whether a round peg that leans towards x fits into a hole somewhere along a lane with its lowest point `edge` from the
    hole's middle, across the lane, and `depth` below the surface, m.
    """
    up = peg * (1.0 - np.cos(RIM)) * math.sin(tilt) - depth
    x, y = edge - peg * (1.0 - np.cos(RIM)) * math.cos(tilt), peg * np.sin(RIM)
    below = up < 0.0
    outline = np.array([np.concatenate([x[below], (x - up * math.tan(tilt))[below]]), np.tile(y[below], 2)])
    return any((np.hypot(outline[0], outline[1] - place) <= hole).all() for place in ALONG)


@pytest.mark.parametrize("tilt", [0.5, 0.785, 1.0])
@pytest.mark.parametrize("fall", [0.3e-3, 0.6e-3])
def test_the_band_in_which_a_peg_falls_lies_evenly_about_its_lanes(tilt, fall):
    """The band is that of the exact shapes: end and side of the peg below the surface within the hole's rim."""
    off = 4e-3 * math.cos(tilt) - leading(4e-3, tilt, fall)
    places = [place for place in np.arange(-5e-3, 5e-3, 0.02e-3) if falls(place, tilt, fall)]
    assert (min(places) + max(places)) / 2 == pytest.approx(off, abs=0.1e-3)
