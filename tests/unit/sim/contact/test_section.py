"""The exact depth by sections, against polygon clipping, which shares nothing with it."""

import math

import numpy as np
import pytest

from drivers.part.rectangular import Rectangular
from drivers.part.round import Round
from sim.contact.rig import attitude, lowest
from sim.contact.shapes import exact_depth
from tests.sections import deepest


@pytest.mark.parametrize("azimuth", [0.0, 0.3, 1.7, 3.0])
@pytest.mark.parametrize("degrees", [1, 5, 15, 45])
@pytest.mark.parametrize("peg", [Rectangular(0.008, 0.008), Rectangular(0.008, 0.012)], ids=str)
def test_a_rectangle_goes_as_deep_as_clipping_says(peg, degrees, azimuth):
    axes = attitude(math.radians(degrees), azimuth)
    assert exact_depth(peg, peg.grown(5e-5), axes) == pytest.approx(deepest(peg, peg.grown(5e-5), axes), abs=1e-7)


@pytest.mark.parametrize("degrees", [1, 5, 45])
def test_a_round_peg_goes_as_deep_as_clipping_says(degrees):
    peg, axes = Round(0.008), attitude(math.radians(degrees), 0.3)
    assert exact_depth(peg, peg.grown(5e-5), axes) == pytest.approx(deepest(peg, peg.grown(5e-5), axes), rel=0.01)


def test_the_lowest_point_of_a_tilted_peg_is_ahead_in_the_direction_of_the_tilt():
    tilt, azimuth, radius = 0.4, 0.7, 0.004
    ahead = radius * math.cos(tilt) * np.array([math.cos(azimuth), math.sin(azimuth)])
    np.testing.assert_allclose(lowest(Round(2 * radius), tilt, azimuth), [*ahead, -radius * math.sin(tilt)], atol=1e-15)
