"""Where the held peg may take the long step: nothing that is judged can be touched there."""

import math

import numpy as np
import pytest

from drivers.frames import rotation_about
from drivers.quantities import Vector
from sim.contact import peg_distances

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
