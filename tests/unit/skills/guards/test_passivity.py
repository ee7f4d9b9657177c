"""The guard stops a swing by its energy, and lets planned motion pass."""

import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.frames import UP, end_point, rotation_about
from drivers.quantities import ImpedanceSetpoint, InHandTip, Pose, Twist
from skills.guards.deviation import INERTIA, LEVER, MASS, WRIST
from skills.guards.passivity import PassivityGuard, PassivityVerdict, share_of_limit
from tests.fakes import HAND_DOWN

PERIOD, LIMIT, STIFF, TURN = 0.01, 60.0, 2500.0, 40.0
ACROSS = np.array([1.0, 0.0, 0.0])


def setpoint(twist=None, in_hand=None):
    stiffness = np.array([STIFF] * 3 + [TURN] * 3)
    return ImpedanceSetpoint(1, np.zeros(3), UP, stiffness, np.ones(6), 1.0, in_hand, None, twist)


def at(x: float, angle: float = 0.0) -> Pose:
    """Return a hand that points down, its wrist moved by `x` and turned by `angle` about the same axis."""
    rotation = rotation_about(ACROSS, angle) @ HAND_DOWN
    return Pose(x * ACROSS + WRIST * rotation[:, 0], rotation)


def swing(guard: PassivityGuard, moves) -> list[PassivityVerdict]:
    """Move by so much of the way that is at the limit in every scan."""
    way, x, verdicts = LIMIT / math.sqrt(MASS * STIFF) * PERIOD, 0.0, []
    for scan, move in enumerate((0.0, *moves)):
        x += move * way
        verdicts.append(guard.update(setpoint(), at(x), 1.0 + scan * PERIOD))
    return verdicts[1:]


PASSIVE, SOFTEN, STOP = PassivityVerdict


@pytest.mark.parametrize(
    ("moves", "verdicts"),
    [([0.9, -0.9, 1.1, -1.1], [PASSIVE, SOFTEN, SOFTEN, STOP]), ([0.1, 3.0, 0.1, 0.1], [PASSIVE] * 4)],
    ids=["swing", "knock in a single scan"],
)
def test_a_swing_is_softened_and_one_beyond_the_limit_stopped(moves, verdicts):
    assert swing(PassivityGuard(LIMIT), moves) == verdicts


def test_a_guard_that_saw_nothing_held_starts_anew():
    guard = PassivityGuard(LIMIT)
    swing(guard, [2.0])
    assert guard.update(None, at(0.0), 0.5) is PASSIVE
    assert swing(guard, [2.0]) == [PASSIVE]


def drawn(seed):
    """Return a hand anywhere, a turn about any axis and a slide of its wrist in any direction, both per second."""
    rng = np.random.default_rng(seed)
    rotation = rotation_about(np.array([0.0, 0.6, 0.8]), rng.uniform(-3.0, 3.0)) @ HAND_DOWN
    rotation = rotation_about(ACROSS, rng.uniform(-3.0, 3.0)) @ rotation
    return Pose(rng.normal(size=3), rotation), rng.normal(size=3), 0.1 * rng.normal(size=3)


def moved_by(hand, point, turn, slide, period):
    """Return the hand after a turn, rad/s, about a point of it that slides, m/s."""
    rate = float(np.linalg.norm(turn))
    turned = rotation_about(turn / rate, rate * period)
    return Pose(point + slide * period + turned @ (hand.position - point), turned @ hand.rotation)


@pytest.mark.parametrize("seed", range(5))
def test_the_energy_is_that_of_slide_and_turn_of_the_wrist(seed):
    hand, turn, slide = drawn(seed)
    wrist = hand.position - WRIST * hand.rotation[:, 0]
    gains = np.array([2500.0, 900.0, 400.0, 40.0, 20.0, 10.0])
    after = moved_by(hand, wrist, turn, slide, 1e-4)
    share = share_of_limit(replace(setpoint(), stiffness=gains), hand, after, 1e-4, LIMIT)
    pushing = MASS * gains[:3] @ slide**2 / LIMIT**2
    assert share == pytest.approx(pushing + INERTIA * gains[3:] @ turn**2 / (LEVER * LIMIT) ** 2, rel=1e-3)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("in_hand", [None, InHandTip(0.4, 0.05)])
def test_a_planned_motion_of_the_pegs_end_is_no_energy(seed, in_hand):
    hand, turn, slide = drawn(seed)
    end = hand.position if in_hand is None else end_point(hand, in_hand.theta, in_hand.length)[0]
    after, held = moved_by(hand, end, turn, slide, 1e-5), (setpoint(Twist(slide, turn), in_hand), setpoint())
    planned, unplanned = (share_of_limit(each, hand, after, 1e-5, LIMIT) for each in held)
    assert planned < 1e-6 < unplanned
