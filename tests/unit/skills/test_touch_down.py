"""The first touch-down measures how far the peg reaches from the hand."""

import math

import numpy as np
import pytest

from drivers.frames import end_point
from drivers.quantities import Pose
from skills.search.feel import EXPLAINED, LONGEST_SLIP, excess_of

BOUND, LENGTH = 0.006, 0.05


def axis_at(tilt):
    return np.array([math.sin(tilt), 0.0, math.cos(tilt)])


@pytest.mark.parametrize("excess", [-0.005, -0.002, 0.002, 0.005])
@pytest.mark.parametrize("tilt", [0.5, 0.7854])
def test_a_peg_that_reaches_further_than_believed_is_measured(excess, tilt):
    assert excess_of(excess * math.cos(tilt), axis_at(tilt), BOUND) == pytest.approx(excess)


def test_what_other_errors_explain_is_left_as_it_is():
    assert excess_of(0.99 * EXPLAINED * math.cos(0.7854), axis_at(0.7854), BOUND) == 0.0


def test_no_more_than_the_bound_is_believed():
    assert excess_of(0.99 * BOUND * math.cos(0.7854), axis_at(0.7854), BOUND) == pytest.approx(0.99 * BOUND)
    assert excess_of(1.01 * BOUND * math.cos(0.7854), axis_at(0.7854), BOUND) is None


@pytest.mark.parametrize("is_plate_high", [False, True])
def test_a_seated_peg_is_where_the_switch_expects_it_whichever_of_peg_and_plate_was_wrong(is_plate_high):
    """Depth of the hole 20 mm, tolerance 4 mm: the correction must serve a long peg and a high plate alike."""
    error, tilt, depth = 0.005, 0.7854, 0.02
    height, longer = (error, 0.0) if is_plate_high else (0.0, error)
    # The hand when the tilted tip touches the true plate; the believed plate is at 0.
    touched = height + (LENGTH + longer) * math.cos(tilt) - LENGTH * math.cos(tilt)
    excess = excess_of(touched, axis_at(tilt), 0.01)
    hand_down = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
    seated = Pose(np.array([0.0, 0.0, height - depth + LENGTH + longer]), hand_down)
    tip, _ = end_point(seated, 0.0, LENGTH + excess)
    assert -tip[2] == pytest.approx(depth, abs=0.0025)


@pytest.mark.parametrize(("slip", "is_believed"), [(0.99 * LONGEST_SLIP, True), (1.01 * LONGEST_SLIP, False)])
def test_a_peg_that_has_touched_before_may_have_slipped_into_the_hand_by_half_the_pads(slip, is_believed):
    excess = excess_of(-slip * math.cos(0.7854), axis_at(0.7854), BOUND, has_touched=True)
    assert excess == (pytest.approx(-slip) if is_believed else None)


def test_a_peg_that_has_touched_before_has_not_grown():
    assert excess_of(1.01 * BOUND * math.cos(0.7854), axis_at(0.7854), BOUND, has_touched=True) is None
