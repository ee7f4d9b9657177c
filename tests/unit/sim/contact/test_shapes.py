"""How deep a peg goes, by sections and by distances."""

import math

import numpy as np
import pytest

from cell.lab.contact_rig import attitude, lowest
from cell.lab.section import exact_depth
from drivers.frames import rotation_about
from drivers.part.rectangular import Rectangular
from drivers.part.round import Round
from drivers.quantities import Vector
from sim.contact import peg_distances
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


def test_the_lowest_point_of_a_tilted_peg_is_ahead():
    tilt, azimuth, radius = 0.4, 0.7, 0.004
    ahead = radius * math.cos(tilt) * np.array([math.cos(azimuth), math.sin(azimuth)])
    np.testing.assert_allclose(lowest(Round(2 * radius), tilt, azimuth), [*ahead, -radius * math.sin(tilt)], atol=1e-15)


HOLE_RADIUS, RADIUS, HALF = 0.00405, 0.004, 0.0325
SIZE = np.array([RADIUS, HALF, 0.0])
MOUTH = np.array([0.5, 0.1, 0.2])
HOLE = np.array([*MOUTH, 0.0, 0.0, 1.0, HOLE_RADIUS])
EDGE = HOLE_RADIUS + RADIUS + peg_distances.FAR
"""Of the peg's end from the hole's axis."""


def is_far(end: Vector, tilt: float = 0.0) -> bool:
    axes = rotation_about(np.array([0.0, 1.0, 0.0]), tilt)
    return bool(peg_distances.is_far(HOLE, SIZE, MOUTH + end + HALF * axes[:, 2], np.ascontiguousarray(axes)))


@pytest.mark.parametrize("azimuth", [0.0, 1.0, 2.5, 4.0])
def test_a_peg_beside_the_hole_is_far_when_its_whole_end_is(azimuth):
    way = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    assert is_far(way * (EDGE + 1e-6))
    assert not is_far(way * (EDGE - 1e-6))


@pytest.mark.parametrize("tilt", [0.0, 0.3, math.pi / 4])
def test_a_peg_above_the_hole_is_far_when_its_lowest_point_is(tilt):
    lowest = RADIUS * math.sin(tilt)
    assert is_far(np.array([0.0, 0.0, peg_distances.FAR + lowest + 1e-6]), tilt)
    assert not is_far(np.array([0.0, 0.0, peg_distances.FAR + lowest - 1e-6]), tilt)


def test_a_peg_in_the_bore_is_never_far():
    assert not is_far(np.array([0.0, 0.0, -0.02]))
