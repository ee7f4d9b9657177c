import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from drivers.frames import end_point, rotation_about
from drivers.quantities import Pose
from skills.tactile.observer import Observer, ObserverParams
from skills.tactile.pose import PegPose

LENGTH, SIGMA, SCAN, PERIOD = 0.05, math.radians(0.4), 0.01, 10
HAND = Pose(np.array([0.5, 0.0, 0.15]), np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]))
CLOSING = HAND.rotation[:, 2]


def turned(angle, hand=HAND):
    """Return the hand after a turn about the closing axis through the finger centre."""
    return Pose(hand.position, rotation_about(CLOSING, angle) @ hand.rotation)


@dataclass
class Grasp:
    """A peg in a hand whose skin tells theta ten times a second, with noise."""

    observer: Observer = field(default_factory=lambda: Observer(ObserverParams()))
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(7))
    scans: int = 0

    def scan(self, theta, hand, late=0.0, is_silent=False):
        """Pass one scan; return the error of what is then known, rad."""
        new = None
        if self.scans % PERIOD == 0 and not is_silent:
            told = theta + SIGMA * self.rng.standard_normal()
            told = (told + math.pi / 2) % math.pi - math.pi / 2
            new = PegPose(told, 0.0, SIGMA, 0.0, True, SCAN * self.scans - late)
        known = self.observer.follow(SCAN * self.scans, hand, LENGTH, new)
        self.scans += 1
        self.known = known
        return known.theta - theta


def rms(errors):
    return math.sqrt(np.mean(np.square(errors)))


def pivoted(grasp, rate, seconds=2.0, late_scans=0):
    """Turn the finger about nothing but itself while the tip is held; return the errors at every scan."""
    tip, _ = end_point(HAND, 0.3, LENGTH)
    hands = [turned(rate * SCAN * n) for n in range(round(seconds / SCAN))]
    errors = []
    for n, hand in enumerate(hands):
        # The hand is carried so that the tip stays: the peg swings about it.
        x, y, _ = hand.rotation.T @ (tip - hand.position)
        theta = math.atan2(y, x)
        reach = math.hypot(x, y) - LENGTH
        hand = Pose(hand.position + reach * hand.rotation @ [math.cos(theta), math.sin(theta), 0.0], hand.rotation)
        hands[n] = hand
        seen = max(n - late_scans, 0)
        x, y, _ = hands[seen].rotation.T @ (tip - hands[seen].position)
        errors.append(grasp.scan(math.atan2(y, x), hand, late=SCAN * (n - seen)) + math.atan2(y, x) - theta)
    grasp.hand, grasp.theta = hand, theta
    return errors


def test_noise_is_averaged_while_the_peg_sticks():
    grasp = Grasp()
    errors = [grasp.scan(0.3, HAND) for _ in range(600)]
    assert rms(errors[200:]) < 0.6 * SIGMA


def test_hand_that_turns_with_the_peg_in_it_leaves_theta_alone():
    grasp = Grasp()
    errors = [grasp.scan(0.3, turned(0.01 * n)) for n in range(300)]
    assert rms(errors[100:]) < SIGMA
    assert grasp.observer.pivoting < 0.2


def test_peg_whose_tip_is_held_is_foreseen_between_frames():
    grasp = Grasp()
    errors = pivoted(grasp, rate=0.4)
    held = 0.4 * SCAN * PERIOD / math.sqrt(3.0)
    assert grasp.observer.pivoting > 0.8
    assert rms(errors[60:]) < 0.5 * held


def test_peg_that_sticks_again_after_its_tip_was_held_is_told_within_a_second():
    grasp = Grasp()
    pivoted(grasp, rate=0.4)
    was_pivoting = grasp.observer.pivoting
    stuck, hand = grasp.theta, grasp.hand
    for n in range(100):
        grasp.scan(stuck, turned(0.004 * n, hand))
    assert was_pivoting > 0.8
    assert grasp.observer.pivoting < 0.2
    assert grasp.observer.slips == 0


def test_late_frame_counts_for_when_it_was_measured():
    on_time, late = Grasp(), Grasp()
    pivoted(on_time, rate=0.4)
    errors = pivoted(late, rate=0.4, late_scans=8)
    assert rms(errors[60:]) < 0.5 * 0.4 * SCAN * 8


def test_slip_is_taken_at_once_and_counted():
    grasp = Grasp()
    for _ in range(100):
        grasp.scan(0.3, HAND)
    errors = [grasp.scan(0.8, HAND) for _ in range(20)]
    assert grasp.observer.slips == 1
    assert rms(errors) < 3.0 * SIGMA


def test_peg_that_turns_past_ninety_degrees_is_followed():
    grasp, errors = Grasp(), []
    for n in range(400):
        errors.append(grasp.scan(1.4 + 0.001 * n, HAND))
    assert rms(errors[50:]) < 3.0 * SIGMA


def test_age_and_sigma_grow_while_no_frame_comes():
    grasp = Grasp()
    for _ in range(101):
        grasp.scan(0.3, HAND)
    fresh = grasp.known
    for _ in range(40):
        grasp.scan(0.3, HAND, is_silent=True)
    assert grasp.known.stamp == fresh.stamp == pytest.approx(1.0)
    assert grasp.known.sigma > fresh.sigma


def test_everything_begins_anew_after_a_long_silence():
    grasp = Grasp()
    for _ in range(100):
        grasp.scan(0.3, HAND)
    for _ in range(200):
        grasp.scan(0.3, HAND, is_silent=True)
    error = grasp.scan(0.6, turned(1.0))
    assert abs(error) < 4.0 * SIGMA
    assert grasp.observer.slips == 0


def test_nothing_is_known_before_the_first_frame():
    assert not Observer(ObserverParams()).follow(0.0, HAND, LENGTH, None).healthy


def test_about_ninety_five_percent_of_the_errors_lie_within_two_sigma():
    grasp = Grasp()
    inside = [abs(grasp.scan(0.3, HAND)) < 1.96 * grasp.known.sigma for _ in range(3000)]
    assert np.mean(inside) > 0.95
