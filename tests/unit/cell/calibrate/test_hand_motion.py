"""An arm that a person moves: by hand beyond a yield, by keys while they are held."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from cell.calibrate.hand_motion import (
    DEAD_MAN,
    GUIDE_SPEED,
    JOG_SPEED,
    MOST_FORCE,
    STIFFNESS,
    TURN_STIFFNESS,
    TURN_YIELD,
    YIELD,
    Held,
    guided,
    jogged,
    moved_by_keys,
)
from cell.config.load import load
from drivers.errors import TrackingError
from drivers.frames import rotation_about
from drivers.quantities import Pose
from tests.fakes import HAND_DOWN, PERIOD, FakeArm, FakeClock

CONFIG = load().cell
LIMITS = CONFIG.limits
AT = np.array([0.5, 0.0, 0.3])
X = np.array([1.0, 0.0, 0.0])


def held(position=AT):
    return Held(Pose(np.array(position), HAND_DOWN), np.zeros(3))


def away(distance, rotation=HAND_DOWN):
    return Pose(AT + distance * X, rotation)


@pytest.mark.parametrize(
    ("distance", "followed"),
    [(0.99 * YIELD / STIFFNESS, 0.0), (YIELD / STIFFNESS + 1e-3, 1e-3), (0.025, GUIDE_SPEED * PERIOD)],
)
def test_the_setpoint_follows_beyond_the_yield_and_no_faster_than_allowed(distance, followed):
    kept = guided(held(), away(distance), PERIOD, LIMITS)
    np.testing.assert_allclose(kept.pose.position, AT + followed * X)


def test_a_turned_hand_is_followed_beyond_its_yield():
    turned = rotation_about(X, TURN_YIELD / TURN_STIFFNESS + 1e-3) @ HAND_DOWN
    follows = guided(held(), away(0.0, turned), PERIOD, LIMITS)
    np.testing.assert_allclose(follows.pose.rotation, rotation_about(X, 1e-3) @ HAND_DOWN, atol=1e-9)


def test_the_setpoint_stays_in_the_workspace():
    edge = np.array([LIMITS.high[0], 0.0, 0.3])
    hand = Pose(edge + 0.02 * X, HAND_DOWN)
    assert guided(held(edge), hand, PERIOD, LIMITS).pose.position[0] == LIMITS.high[0]
    assert jogged(held(edge), Pose(edge, HAND_DOWN), X, PERIOD, LIMITS).pose.position[0] == LIMITS.high[0]


def test_a_blocked_jog_presses_with_a_bounded_force():
    pressed = held()
    for _ in range(1000):
        pressed = jogged(pressed, away(0.0), X, PERIOD, LIMITS)
    assert STIFFNESS * np.linalg.norm(pressed.pose.position - AT) <= 0.5 * MOST_FORCE


class Script:
    """Keys at given times, and the end at another."""

    def __init__(self, clock, presses, end):
        self.clock, self.presses, self.end = clock, list(presses), end

    def next(self, is_waiting):
        if self.clock.time >= self.end:
            return "q"
        return self.presses.pop(0)[1] if self.presses and self.presses[0][0] <= self.clock.time else ""


def jog(presses, end, is_guided=False, actions=()):
    clock = FakeClock()
    arm = FakeArm(clock)
    clock.at = [(time, partial(action, arm)) for time, action in actions]
    follow, arm.told = arm.follow, []
    arm.follow = lambda setpoint: (arm.told.append(setpoint), follow(setpoint))
    cell = SimpleNamespace(config=CONFIG, clock=clock, arm=arm)
    start = arm.tcp.position.copy()
    moved_by_keys(cell, Script(clock, presses, end), lambda key, state: True, is_guided)
    return arm, arm.tcp.position - start


def test_one_key_moves_the_tool_until_the_dead_man_ends_it():
    arm, moved = jog([(0.0, "x")], 1.0)
    assert moved == pytest.approx([JOG_SPEED * DEAD_MAN, 0.0, 0.0], abs=2 * JOG_SPEED * PERIOD)
    assert arm.is_halted
    assert max(setpoint.valid_until for setpoint in arm.told) == pytest.approx(DEAD_MAN)


def test_a_key_held_moves_on_and_capitals_go_back():
    _, forth = jog([(0.1 * k, "z") for k in range(10)], 2.0)
    _, back = jog([(0.1 * k, "Z") for k in range(10)], 2.0)
    assert forth[2] == pytest.approx(JOG_SPEED * (0.9 + DEAD_MAN), abs=3 * JOG_SPEED * PERIOD)
    np.testing.assert_allclose(back, -forth, atol=1e-9)


def test_a_hand_that_is_moved_too_fast_ends_it():
    def push(arm):
        arm.tcp = Pose(arm.tcp.position + 0.006 * X, arm.tcp.rotation)

    with pytest.raises(TrackingError, match=r"moved at 0\.\d+ m/s by hand"):
        jog([], 1.0, is_guided=True, actions=[(0.1, push)])
