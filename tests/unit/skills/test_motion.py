"""Properties that the setpoints of several skills share."""

import math

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP, rotation_about
from skills.catalogue import GRASP
from skills.contract import Interrupted, Reason
from skills.motion import (
    STRAY,
    VALIDITY,
    Goal,
    Trim,
    Way,
    anchored,
    between,
    minimum_jerk,
    move,
    spin_between,
    tilted_by,
)
from tests.fakes import FakeClock, FakeGripper, context_of
from tests.unit.skills.benches import WatchedArm

CONFIG = load().cell
SIDE = np.array([1.0, 0.0, 0.0])


@pytest.mark.parametrize(("breadth", "stray"), [(0.004, STRAY), (0.008, STRAY), (0.02, 0.01)])
def test_a_setpoint_follows_the_tip_as_far_as_a_leaning_peg_s_end_goes_while_it_is_turned_upright(breadth, stray):
    found = np.array([0.5, 0.1, 0.08])
    for way, kept in ((0.5 * stray, 0.5 * stray), (3.0 * stray, stray)):
        tip = anchored(found + np.array([0.6 * way, -0.8 * way, -0.01]), found, breadth)
        assert tip == pytest.approx(found + np.array([0.6 * kept, -0.8 * kept, -0.01]))


@pytest.fixture
def ctx():
    return context_of(CONFIG, WatchedArm(FakeClock()), FakeGripper(0.008))


TRANSFER = CONFIG.params(GRASP).transfer


def moved(ctx, goal, in_hand=None, settle=0.3, limited=True):
    """Go to a goal; return the time and the setpoint of each scan."""
    told = len(ctx.devices.arm.told)
    for _ in move(goal, TRANSFER, ctx, in_hand, settle, limited):
        pass
    return ctx.devices.arm.told[told:]


def beside(ctx, way, turn=0.0):
    """Return the goal that lies so far from where the hand is, m, turned by so much about the vertical, rad."""
    tcp = ctx.devices.arm.tcp
    turned = rotation_about(UP, turn) @ tcp.rotation
    return Goal(tcp.position + np.array(way), -turned[:, 0], turned[:, 2])


@pytest.mark.parametrize(("way", "turn"), [((0.0, 0.06, 0.1), 0.0), ((0.0, 0.02, 0.0), 1.2), ((0.0, 0.0, 0.0), -0.4)])
def test_a_move_gets_to_its_goal_within_the_speeds_of_its_transfer_fed_forward_by_its_own_rate(ctx, way, turn):
    goal, start = beside(ctx, way, turn), ctx.devices.arm.tcp
    told = moved(ctx, goal)
    last, tips = told[-1][1], np.array([each.tip for _, each in told])
    rolls = np.array([each.roll for _, each in told])
    assert last.tip == pytest.approx(goal.tip)
    assert last.roll == pytest.approx(goal.roll)
    assert max(np.linalg.norm(each.twist.linear) for _, each in told) <= TRANSFER.speed + 1e-9
    assert max(np.linalg.norm(each.twist.angular) for _, each in told) <= TRANSFER.turn_speed + 1e-9
    # The rate of the setpoint is fed forward.
    for k in range(1, len(told) - 1):
        assert told[k][1].twist.linear == pytest.approx((tips[k + 1] - tips[k - 1]) / 0.02, abs=3e-3)
        turning = float(UP @ np.cross(rolls[k - 1], rolls[k + 1])) / 0.02
        assert told[k][1].twist.angular[2] == pytest.approx(turning, abs=0.02)
    assert tips[0] == pytest.approx(start.position)
    gains = TRANSFER.gains
    assert last.stiffness.tolist() == [gains.translation] * 3 + [gains.rotation] * 2 + [gains.rotation / 2.0]
    assert len({each.id for _, each in told}) == 1
    assert all(each.valid_until == pytest.approx(now + VALIDITY) and each.is_free for now, each in told)
    assert last.id != moved(ctx, beside(ctx, (0.0, 0.01, 0.0)))[0][1].id


@pytest.mark.parametrize("settle", [0.0, 0.3])
def test_a_move_is_over_once_it_has_settled(ctx, settle):
    way = Way(Goal(np.zeros(3), UP, SIDE), Goal(np.array([0.1, 0.0, 0.0]), UP, SIDE))
    duration = 1.875 * 0.1 / TRANSFER.speed
    assert way.duration(TRANSFER) == pytest.approx(duration)
    goal = beside(ctx, (0.0, 0.1, 0.0))
    assert moved(ctx, goal, settle=settle)[-1][0] == pytest.approx(duration + settle, abs=0.011)


def test_the_axis_turns_about_one_line_and_back_through_any_other_from_one_end_to_the_opposite():
    for start in (UP, SIDE, np.array([0.6, 0.0, 0.8])):
        across = np.cross(start, np.array([0.0, 1.0, 0.0]))
        way = Way(Goal(np.zeros(3), start, across), Goal(np.zeros(3), -start, across))
        assert way.at(0.0)[0].axis == pytest.approx(start)
        assert way.at(1.0)[0].axis == pytest.approx(-start, abs=1e-9)
        assert float(way.at(0.5)[0].axis @ start) == pytest.approx(0.0, abs=1e-9)
        assert way.at(1.0)[0].roll == pytest.approx(across, abs=1e-9)


def test_only_a_way_out_goes_without_the_limits(ctx):
    ctx.devices.arm.force = np.array([0.0, 0.0, 1.1 * ctx.limits.force])
    goal = beside(ctx, (0.0, 0.01, 0.0))
    assert moved(ctx, goal, limited=False)
    with pytest.raises(Interrupted) as ended:
        moved(ctx, goal)
    assert ended.value.reason is Reason.FORCE_LIMIT


@pytest.mark.parametrize("is_held", [True, False])
def test_a_peg_that_is_lost_on_the_way_ends_the_move_of_a_hand_that_holds_one(ctx, is_held):
    ctx.devices.gripper.grip(30.0)
    goal = beside(ctx, (0.0, 0.1, 0.0))
    ctx.devices.clock.at.append((0.1, lambda: setattr(ctx.devices.gripper, "has_peg", False)))
    if not is_held:
        assert moved(ctx, goal)[-1][0] > 0.5
        return
    with pytest.raises(Interrupted) as ended:
        moved(ctx, Goal(goal.tip - CONFIG.peg.length * UP, goal.axis, goal.roll), ctx.in_hand())
    assert ended.value.reason is Reason.LOST_GRASP


def test_a_trim_adds_up_what_is_missing_up_to_its_limit_on_either_side():
    trim = Trim(rate=2.0, limit=0.01).after(0.1, 0.01).after(0.1, 0.01)
    assert trim.value == pytest.approx(2 * 2.0 * 0.1 * 0.01)
    assert trim.after(-0.2, 0.01).value == pytest.approx(0.0)
    assert (trim.after(10.0, 1.0).value, trim.after(-10.0, 1.0).value) == (0.01, -0.01)


def test_the_finger_centre_of_the_spiral_stands_where_it_was_drawn():
    np.testing.assert_allclose(0.05 * tilted_by(np.array([0.006, -0.008]), 0.05)[:2], [0.006, -0.008], atol=1e-15)


def test_a_minimum_jerk_move_starts_and_ends_at_rest():
    assert [minimum_jerk(share) for share in (0.0, 0.5, 1.0)] == [(0.0, 0.0), (0.5, 1.875), (1.0, 0.0)]


@pytest.mark.parametrize("rate", [0.0, 0.7, -2.0])
def test_the_spin_between_two_rotations_is_the_rate_at_which_one_becomes_the_other(rate):
    before = rotation_about(SIDE, 0.4)
    assert spin_between(before, rotation_about(UP, 0.01 * rate) @ before, 0.01) == pytest.approx(rate * UP, abs=1e-3)


@pytest.mark.parametrize(("share", "angle"), [(0.0, 0.0), (0.5, math.pi / 4), (1.0, math.pi / 2)])
def test_a_direction_between_two_is_of_unit_length_and_nearer_to_what_weighs_more(share, angle):
    assert between(SIDE, UP, share) == pytest.approx(math.cos(angle) * SIDE + math.sin(angle) * UP)
