"""A hand that goes blind keeps what the grasp told, or knows nothing, and its frames still come."""

import numpy as np
import pytest

from drivers.quantities import Pose
from skills.tactile.blend import Smoothing
from skills.tactile.blind import FIRST, Blind
from skills.tactile.pose import PegPose

HAND = Pose(np.array([0.5, 0.0, 0.15]), np.eye(3))


def followed(method: str, *frames: tuple[float, float]) -> PegPose:
    """Return what a blind hand knows after frames of these stamps and angles."""
    tracker = Blind(Smoothing.model_validate({"method": method}))
    known = tracker.follow(0.0, HAND, 0.05, None)
    assert not known.healthy
    for stamp, theta in frames:
        known = tracker.follow(stamp, HAND, 0.05, PegPose(theta, 0.001, 0.01, 0.0, True, stamp))
    return known


def test_frozen_theta_is_the_last_of_the_grasp():
    known = followed("frozen", (0.0, 0.3), (FIRST, 0.2), (FIRST + 0.1, 0.9))
    assert (known.theta, known.stamp) == (pytest.approx(0.2), FIRST + 0.1)


def test_a_peg_taken_to_lie_straight_has_no_angle_and_no_offset():
    known = followed("straight", (0.0, 0.3), (0.1, 0.4))
    assert (known.theta, known.offset, known.stamp, known.healthy) == (0.0, 0.0, 0.1, True)
