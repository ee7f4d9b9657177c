"""How deep a leaning peg goes, and how far a peg in its hole leans, against shapes that are known otherwise."""

import math

import numpy as np
import pytest

from sim.contact.section import section_depth
from skills.insert.play import STEEPEST, allowed_depth, allowed_tilt


@pytest.mark.parametrize(("peg", "hole"), [(0.008, 0.00802), (0.008, 0.0081), (0.004, 0.0041), (0.016, 0.0162)])
@pytest.mark.parametrize("degrees", [4.0, 5.7, 7.5])
def test_what_a_tilt_allows_is_as_deep_as_the_exact_section_says(peg: float, hole: float, degrees: float) -> None:
    phi = math.radians(degrees)
    assert allowed_depth(phi, peg, hole) == pytest.approx(section_depth(peg, hole, phi, 4001), abs=1e-6)


@pytest.mark.parametrize("depth", [2e-3, 5e-3, 0.01, 0.02])
def test_the_most_lean_of_a_peg_makes_it_touch_both_walls(depth):
    lean = allowed_tilt(depth, 8e-3, 8.1e-3)
    turn = np.array([[math.cos(lean), math.sin(lean)], [-math.sin(lean), math.cos(lean)]])
    # The section of the peg in the plane of its lean: the side above the lowest corner touches the mouth, the other corner the other wall.
    lowest, other, along = turn @ [4e-3, 0.0], turn @ [-4e-3, 0.0], turn @ [0.0, 1.0]
    mouth = lowest + along * depth / along[1]
    assert mouth[0] - other[0] == pytest.approx(8.1e-3, rel=1e-6)


def test_the_most_lean_of_a_peg_that_is_hardly_in_is_the_steepest_that_is_looked_at():
    assert allowed_tilt(1e-3, 8e-3, 8.1e-3) == pytest.approx(STEEPEST)
