"""A hand that goes blind keeps the theta of the grasp, or takes theta for 0, and its frames still come."""

import pytest

from cell.lab.touch import FIRST, Frozen, Straight
from skills.tactile.blend import Smoothing
from skills.tactile.pose import PegPose, Tracker


def followed(tracker: Tracker, *frames: tuple[float, float]) -> PegPose:
    """Return the pose after frames of these stamps and angles."""
    known = tracker.follow(None, 0.0, 0.0)
    assert not known.healthy
    for stamp, theta in frames:
        known = tracker.follow(PegPose(theta, 0.001, 0.01, 0.0, True, stamp), stamp, 0.0)
    return known


def test_frozen_theta_is_the_last_of_the_grasp():
    known = followed(Frozen(Smoothing()), (0.0, 0.3), (FIRST, 0.2), (FIRST + 0.1, 0.9))
    assert (known.theta, known.stamp) == (pytest.approx(0.2), FIRST + 0.1)


def test_a_peg_taken_to_lie_straight_has_no_angle_and_no_offset():
    known = followed(Straight(), (0.0, 0.3), (0.1, 0.4))
    assert (known.theta, known.offset, known.stamp, known.healthy) == (0.0, 0.0, 0.1, True)
