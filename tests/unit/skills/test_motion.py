"""Paths, and properties that the setpoints of several skills share."""

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
    TransferPath,
    Trim,
    anchored,
    between,
    minimum_jerk,
    move,
    spin_between,
    tilted_by,
)
from skills.paths import TURN_TIME, Lanes, dither, lanes, spiral, spiral_at_speed
from tests.unit.skills.benches import watched

CONFIG = load().cell
SIDE = np.array([1.0, 0.0, 0.0])


@pytest.mark.parametrize(("breadth", "stray"), [(0.004, STRAY), (0.008, STRAY), (0.02, 0.01)])
def test_a_setpoint_follows_the_tip_as_far_as_its_end_can_go(breadth, stray):
    found = np.array([0.5, 0.1, 0.08])
    for way, kept in ((0.5 * stray, 0.5 * stray), (3.0 * stray, stray)):
        tip = anchored(found + np.array([0.6 * way, -0.8 * way, -0.01]), found, breadth)
        assert tip == pytest.approx(found + np.array([0.6 * kept, -0.8 * kept, -0.01]))


@pytest.fixture
def ctx():
    return watched(CONFIG, grip=0.0)


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
def test_a_move_reaches_its_goal_within_the_speeds_of_its_transfer(ctx, way, turn):
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
    way = TransferPath(Goal(np.zeros(3), UP, SIDE), Goal(np.array([0.1, 0.0, 0.0]), UP, SIDE))
    duration = 1.875 * 0.1 / TRANSFER.speed
    assert way.duration(TRANSFER) == pytest.approx(duration)
    goal = beside(ctx, (0.0, 0.1, 0.0))
    assert moved(ctx, goal, settle=settle)[-1][0] == pytest.approx(duration + settle, abs=0.011)


def test_a_move_turns_the_axis_to_the_opposite_evenly():
    for start in (UP, SIDE, np.array([0.6, 0.0, 0.8])):
        across = np.cross(start, np.array([0.0, 1.0, 0.0]))
        way = TransferPath(Goal(np.zeros(3), start, across), Goal(np.zeros(3), -start, across))
        assert way.at(0.0)[0].axis == pytest.approx(start)
        assert way.at(1.0)[0].axis == pytest.approx(-start, abs=1e-9)
        assert float(way.at(0.5)[0].axis @ start) == pytest.approx(0.0, abs=1e-9)
        assert way.at(1.0)[0].roll == pytest.approx(across, abs=1e-9)


def test_a_motion_that_can_start_in_contact_teaches_no_friction(ctx):
    told = moved(ctx, beside(ctx, (0.0, 0.01, 0.0)), limited=False)
    assert not any(each.is_free for _, each in told)


def test_only_a_way_out_goes_without_the_limits(ctx):
    ctx.devices.arm.force = np.array([0.0, 0.0, 1.1 * ctx.limits.force])
    goal = beside(ctx, (0.0, 0.01, 0.0))
    assert moved(ctx, goal, limited=False)
    with pytest.raises(Interrupted) as ended:
        moved(ctx, goal)
    assert ended.value.reason is Reason.FORCE_LIMIT


@pytest.mark.parametrize("is_held", [True, False])
def test_a_lost_peg_ends_the_move_of_a_hand_with_a_peg(ctx, is_held):
    ctx.devices.gripper.grip(30.0)
    goal = beside(ctx, (0.0, 0.1, 0.0))
    ctx.devices.clock.at.append((0.1, lambda: setattr(ctx.devices.gripper, "has_peg", False)))
    if not is_held:
        assert moved(ctx, goal)[-1][0] > 0.5
        return
    with pytest.raises(Interrupted) as ended:
        moved(ctx, Goal(goal.tip - CONFIG.peg.length * UP, goal.axis, goal.roll), ctx.in_hand())
    assert ended.value.reason is Reason.LOST_GRASP


def test_a_trim_integrates_the_error_up_to_its_limits():
    trim = Trim(rate=2.0, limit=0.01).after(0.1, 0.01).after(0.1, 0.01)
    assert trim.value == pytest.approx(2 * 2.0 * 0.1 * 0.01)
    assert trim.after(-0.2, 0.01).value == pytest.approx(0.0)
    assert (trim.after(10.0, 1.0).value, trim.after(-10.0, 1.0).value) == (0.01, -0.01)


def test_a_tilt_stands_where_it_was_drawn_and_moves_end_at_rest():
    np.testing.assert_allclose(0.05 * tilted_by(np.array([0.006, -0.008]), 0.05)[:2], [0.006, -0.008], atol=1e-15)
    assert [minimum_jerk(share) for share in (0.0, 0.5, 1.0)] == [(0.0, 0.0), (0.5, 1.875), (1.0, 0.0)]


@pytest.mark.parametrize("rate", [0.0, 0.7, -2.0])
def test_the_spin_between_two_rotations_is_their_rate(rate):
    before = rotation_about(SIDE, 0.4)
    assert spin_between(before, rotation_about(UP, 0.01 * rate) @ before, 0.01) == pytest.approx(rate * UP, abs=1e-3)


@pytest.mark.parametrize(("share", "angle"), [(0.0, 0.0), (0.5, math.pi / 4), (1.0, math.pi / 2)])
def test_a_direction_between_two_is_unit_and_weighted(share, angle):
    assert between(SIDE, UP, share) == pytest.approx(math.cos(angle) * SIDE + math.sin(angle) * UP)


HALF = (0.03, 0.03)


def test_neighbouring_turns_are_evenly_spaced() -> None:
    growth, turn_rate = 0.001, 2 * math.pi
    one_turn, two_turns = (spiral(n, growth, turn_rate) for n in (1.0, 2.0))
    assert np.linalg.norm(two_turns - one_turn) == pytest.approx(growth)


def test_circles_swell_from_nothing_and_fade_to_nothing() -> None:
    sizes = [float(np.linalg.norm(dither(t, 0.007, 12.0, 1.0))) for t in np.linspace(0.0, 0.999, 200)]
    assert sizes[0] == 0.0
    assert max(sizes) == pytest.approx(0.007, rel=0.02)
    assert sizes[-1] < 1e-4


@pytest.mark.parametrize("fast", [0, 1])
def test_lanes_begin_at_the_nearest_corner_and_miss_no_place(fast: int) -> None:
    pitch, speed, run_in = 0.005, 0.1, 0.004
    path = lanes(HALF, pitch, speed, fast, (-0.02, 0.01), run_in)
    first = np.array([-0.03, 0.03]) * (1.0 - 1.0 / path.lanes)
    first[fast] = (-0.034, 0.034)[fast]
    np.testing.assert_allclose(path.at(0.0)[0], first)
    swept = np.array([path.at(t)[0] for t in np.arange(0.0, path.cover, 0.002)])
    assert np.abs(swept[20:, fast]).max() == pytest.approx(0.03, abs=1e-5)
    grid = np.stack(np.meshgrid(*[np.linspace(-0.03, 0.03, 25)] * 2), axis=-1).reshape(-1, 2)
    gaps = np.sqrt(((grid[:, None] - swept[None]) ** 2).sum(axis=2)).min(axis=1)
    inside = np.abs(grid[:, fast]) < 0.03 - speed * TURN_TIME / 4
    assert gaps[inside].max() <= pitch / 2 + 2e-4
    assert gaps.max() <= 0.8 * pitch


def middle_of(path: Lanes, lane: int) -> float:
    """Return the time at which a path whose first lane begins at the border is half-way along a lane, s."""
    return (lane + 0.5) * (path.cover - TURN_TIME / 4) / path.lanes - TURN_TIME / 4


def test_every_second_cover_runs_between_the_lanes_before() -> None:
    path = lanes(HALF, 0.005, 0.1, 1, (0.0275, 0.03), 0.0)
    first = [path.at(middle_of(path, lane))[0][0] for lane in range(path.lanes)]
    second = [path.at(middle_of(path, path.lanes + lane))[0][0] for lane in range(path.lanes + 1)]
    third = [path.at(middle_of(path, 2 * path.lanes + 1 + lane))[0][0] for lane in range(path.lanes)]
    np.testing.assert_allclose(second, np.linspace(-0.03, 0.03, path.lanes + 1), atol=1e-12)
    np.testing.assert_allclose(sorted(first), (np.array(second[1:]) + second[:-1]) / 2, atol=1e-12)
    np.testing.assert_allclose(third, first)


def test_the_lanes_velocity_is_the_derivative_of_their_place() -> None:
    path = lanes(HALF, 0.005, 0.1, 0, (0.01, -0.01), 0.004)
    for time in (0.02, 0.1, 0.66, 0.72, 0.78, 1.3):
        before, after = path.at(time - 1e-6)[0], path.at(time + 1e-6)[0]
        np.testing.assert_allclose((after - before) / 2e-6, path.at(time)[1], atol=1e-5)


def test_a_probing_spiral_keeps_its_speed_and_pitch() -> None:
    points = np.array([spiral_at_speed(t, 0.03, 0.0015) for t in np.arange(0.2, 0.6, 1e-3)])
    speeds = np.linalg.norm(np.diff(points, axis=0), axis=1) / 1e-3
    np.testing.assert_allclose(speeds, 0.03, rtol=0.15)
