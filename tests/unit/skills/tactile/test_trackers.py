"""Theta between frames: time stamps count, and the age of theta is there to see."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from cell.config.load import load
from skills.tactile.blend import Blend, Smoothing
from skills.tactile.pose import PegPose, Tracker

SIGMA = math.radians(0.4)
TRACKERS = [lambda: Blend(Smoothing()), lambda: Blend(Smoothing(softest=0.0))]

every_tracker = pytest.mark.parametrize("make", TRACKERS, ids=["twisted", "held"])
Make = Callable[[], Tracker]


def frame(theta: float, stamp: float) -> PegPose:
    return PegPose(theta, 0.0, SIGMA, 0.0, True, stamp)


def settled(make: Make) -> Tracker:
    """Return one that has seen theta = 0.3 for a second, the last frame at 1.0 s."""
    tracker = make()
    for scan in range(101):
        tracker.follow(frame(0.3, 0.01 * scan) if scan % 10 == 0 else None, 0.01 * scan, 0.0)
    return tracker


@every_tracker
def test_the_age_of_theta_is_that_of_its_newest_frame(make: Make) -> None:
    tracker = settled(make)
    for now in (1.01, 1.2, 1.5):
        assert now - tracker.follow(None, now, 0.0).stamp == pytest.approx(now - 1.0)
    assert tracker.follow(frame(0.3, 1.1), 1.55, 0.0).stamp == pytest.approx(1.1)


@every_tracker
@pytest.mark.parametrize("stamp", [0.95, 1.0])
def test_frame_that_was_overtaken_changes_nothing(make: Make, stamp: float) -> None:
    late, undisturbed = settled(make).follow(frame(0.9, stamp), 1.1, 0.0), settled(make).follow(None, 1.1, 0.0)
    assert (late.theta, late.stamp) == (undisturbed.theta, undisturbed.stamp)


def test_a_slip_counts_at_the_second_frame_that_shows_it() -> None:
    tracker = settled(lambda: Blend(Smoothing()))
    first, second = (tracker.follow(frame(theta, now), now, 0.0) for now, theta in ((1.1, 0.8), (1.2, 1.1)))
    assert (first.theta, first.stamp) == (pytest.approx(0.3, abs=1e-6), 1.1)
    assert (second.theta, second.stamp) == (1.1, 1.2)


def test_false_frames_that_come_alone_make_no_jump_of_theta() -> None:
    tracker = settled(lambda: Blend(Smoothing()))
    told = [(1.1, -0.5), (1.2, 0.3), (1.3, -0.5), (1.4, 1.0), (1.5, 0.31)]
    assert [tracker.follow(frame(theta, now), now, 0.0).theta for now, theta in told] == pytest.approx(
        [0.3] * 4 + [0.31]
    )


@every_tracker
def test_peg_that_stands_still_is_known_no_worse_than_a_frame_tells(make: Make) -> None:
    rng, tracker, errors = np.random.default_rng(4), settled(make), []
    for scan in range(101, 1100):
        new = frame(0.3 + SIGMA * rng.standard_normal(), 0.01 * scan) if scan % 10 == 0 else None
        errors.append(tracker.follow(new, 0.01 * scan, 0.0).theta - 0.3)
    assert float(np.std(errors)) < 1.05 * SIGMA


def test_a_wrong_first_frame_is_corrected():
    """While fingers close, any angle can be measured; from 80 degrees on, -30 would be nearest as 150."""
    wrong, right = frame(math.radians(80.0), 0.0), frame(math.radians(-30.0), 0.1)
    assert Smoothing().take(wrong, right).theta == right.theta
    assert Smoothing().take(frame(1.5, 0.0), frame(-1.5, 0.1)).theta == pytest.approx(math.pi - 1.5)


SOFT = 1.85
"""Twist of the peg in pads of 5 kN/m, rad/(N·m)."""
AGE = 0.05
"""Age of a frame when it comes, s."""


def pressed(softness: float, smoothing: Smoothing) -> tuple[list[float], list[float]]:
    """Return the angles that a tracker gives, and the true ones, rad, in the fifth second of a peg under a changing moment."""
    tracker, told, true = Blend(smoothing), [], []
    for scan in range(500):
        now = 0.01 * scan
        theta = {time: 0.3 + softness * 0.04 * math.sin(9.0 * time) for time in (now, now - AGE)}
        new = frame(theta[now - AGE], now - AGE) if scan % 10 == 0 else None
        told.append(tracker.follow(new, now, 0.04 * math.sin(9.0 * now)).theta)
        true.append(theta[now])
    return told[400:], true[400:]


@pytest.mark.parametrize("softness", [0.0, 0.19, SOFT])
def test_theta_between_frames_follows_the_moment_on_the_peg(softness: float) -> None:
    told, true = pressed(softness, Smoothing())
    assert told == pytest.approx(true, abs=max(0.1 * softness * 0.04, 1e-9))


def test_the_published_method_holds_theta_between_frames() -> None:
    tracker = settled(lambda: Blend(load(preset="paper").cell.smoothing))
    assert tracker.follow(frame(1.2, 1.1), 1.1, 0.0).theta == pytest.approx(1.2)
    told, true = pressed(SOFT, load(preset="paper").cell.smoothing)
    assert len(set(told)) == 10
    assert max(map(abs, np.subtract(told, true))) > 0.03


def test_a_moment_that_no_frame_confirms_leaves_theta() -> None:
    tracker = settled(lambda: Blend(Smoothing()))
    assert tracker.follow(None, 1.05, 0.4).theta == pytest.approx(0.3)
