"""The decisions of the adjustment, each by itself."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config import load
from cell.margins import inertias
from drivers.arm.dynamics import critical_damping
from drivers.frames import end_point, rotation_about
from drivers.quantities import ArmState, InHandTip, Pose, Wrench
from skills.catalogue import ADJUST
from skills.contract import Outcome, Reason
from skills.guided_peg import CREEP, MOST_SWEPT, SLIDING, SWEPT_BEYOND, Aim, Descent, Guide, Stall, TiltSweep
from skills.seating import CLOSED_TOLERANCE, OPEN_TOLERANCE
from skills.spiral_adjust import MOST_SWING_DAMPING, RAISED, Swing, given_up_after, run
from tests.fakes import HAND_DOWN, Rig
from tests.unit.skills.test_latch_likelihood import way_down

PARAMS = load().cell.params(ADJUST)
PERIOD, LEAST = PARAMS.dither_period, PARAMS.jammed
DEEP = PARAMS.guided_depth + 1e-6
SIDE = np.array([0.0, 1.0, 0.0])


def test_less_than_the_least_gain_is_no_gain():
    stall = Stall().after(1e-3, 1.0, LEAST)
    assert stall.after(1e-3 + LEAST, 2.0, LEAST) == stall
    assert stall.after(1e-3 + 1.01 * LEAST, 2.0, LEAST).since == 2.0


def test_another_theta_is_no_gain_in_depth():
    stall = Stall(deepest=2e-3, since=1.0).measured_anew(depth=2.5e-3, before=1.9e-3)
    assert (stall.deepest, stall.since) == (pytest.approx(2.6e-3), 1.0)


def test_the_hole_guides_from_its_depth_on_and_for_good():
    shallow = Guide().after(PARAMS.guided_depth, 1.0, PARAMS)
    guided = shallow.after(DEEP, 2.0, PARAMS)
    assert (shallow.is_on, guided.is_on, guided.began) == (False, True, 2.0)
    assert guided.after(0.0, 2.1, PARAMS).began == 2.0


@pytest.mark.parametrize(("gain", "is_jammed"), [(0.0, True), (0.99 * CREEP, True), (1.01 * CREEP, False)])
def test_a_period_in_which_the_peg_creeps_is_a_jam(gain, is_jammed):
    guide = replace(Guide().after(DEEP, 1.0, PARAMS), reached=5e-3)
    assert not guide.after(5e-3, 1.0 + 0.99 * PERIOD, PARAMS).is_jammed
    assert guide.after(5e-3 + gain * LEAST, 1.0 + 1.01 * PERIOD, PARAMS).is_jammed is is_jammed


def test_the_spiral_grows_and_the_guided_circles_fade():
    free = [np.linalg.norm(Guide().offset(time, PARAMS, 1.0)) for time in (1.0, 2.0)]
    guided = [np.linalg.norm(Guide(began=1.0).offset(1.0 + share * PERIOD, PARAMS, 1.0)) for share in (0.1, 0.9)]
    assert free == pytest.approx([PARAMS.growth, 2 * PARAMS.growth])
    assert guided[1] < guided[0] <= PARAMS.dither_radius


def test_a_peg_that_slides_is_not_dithered_and_one_that_rests_is():
    resting = sliding = Descent(0.0)
    for scan in range(1, 31):
        resting, sliding = resting.after(0.0, 0.01), sliding.after(1.01 * SLIDING * 0.01 * scan, 0.01)
    sizes = [
        float(np.linalg.norm(Guide(began=0.0).offset(0.2 * PERIOD, PARAMS, each.rest))) for each in (resting, sliding)
    ]
    assert sizes == pytest.approx([0.8 * PARAMS.dither_radius, 0.0], abs=0.25 * PARAMS.dither_radius)
    assert sizes[1] == 0.0


def turning(rate, stamps):
    """Return the swing of a hand that turns at `rate`, rad/s, in states of the arm at these times, s."""
    swing = Swing(HAND_DOWN[:, 0], float(stamps[0]))
    for stamp in stamps:
        tcp = Pose(np.zeros(3), rotation_about(SIDE, rate * stamp) @ HAND_DOWN)
        swing = swing.after(ArmState(stamp, np.zeros(7), np.zeros(7), tcp, Wrench(np.zeros(3), np.zeros(3)), 2, 0.0))
    return swing


@pytest.mark.parametrize("stamps", [np.arange(0.0, 0.3, 0.01), np.arange(0.0, 1.2, 0.1)])
def test_the_swing_of_a_hand_is_its_turning_rate_however_late_the_scans_come(stamps):
    assert turning(0.7, stamps).rate == pytest.approx(0.7, rel=0.01)


def test_a_state_of_the_arm_that_is_read_twice_tells_no_other_swing():
    swing = turning(0.7, [0.0, 0.01])
    assert turning(0.7, [0.0, 0.01, 0.01]).rate == swing.rate


def test_a_peg_is_let_down_the_more_gently_the_faster_the_hand_turns_and_as_ever_while_it_is_dithered():
    dithered = Swing(SIDE, 0.0, PARAMS.dither_rate * PARAMS.dither_radius / load().cell.peg.length)
    slow, fast = (Swing(SIDE, 0.0, rate) for rate in (0.5, 1.0))
    assert (dithered.damping, dithered.push) == (1.0, 1.0)
    assert 1.0 < slow.damping < fast.damping == MOST_SWING_DAMPING
    assert 1.0 > slow.push > fast.push > 0.3


def test_the_published_adjustment_knows_no_swing():
    assert load(sets=["preset=paper"]).cell.params(ADJUST).swing_time == 0.0


@pytest.mark.parametrize("preset", ["balanced", "fast", "careful"])
def test_torques_that_act_as_late_as_a_careless_arms_bear_the_damping_of_a_swing(preset):
    # One mode of damping alone, v' = -r v, whose torque comes after T behind a low-pass of L, is stable up to
    # r = w sqrt(1 + (w L)^2) with w T + atan(w L) a quarter of a turn.
    cell = load(sets=[f"preset={preset}"]).cell
    params = cell.params(ADJUST)
    transport, lag = 2 * 0.002, 2 * 0.0016
    low, high = 1.0, math.pi / 2 / transport
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if middle * transport + math.atan(middle * lag) < math.pi / 2 else (low, middle)
    stiffness, ratios = params.gains.stiffness(), params.gains.damping_ratios()
    stiffness[2], ratios[2] = params.push_stiffness, MOST_SWING_DAMPING * params.push_damping_ratio
    for inertia in inertias(cell.place())[1:]:  # the peg is upright
        damping = np.sqrt(np.outer(ratios, ratios)) * critical_damping(inertia, stiffness)
        rates = np.abs(np.linalg.eigvals(np.linalg.solve(inertia, damping)))
        assert 1.2 * rates.max() < low * math.hypot(1.0, low * lag)


def test_a_tip_that_rises_slides_nowhere():
    assert Descent(5e-3).after(4e-3, 0.01).rest == 1.0


def test_after_a_jam_the_peg_is_aimed_where_it_rests_and_after_the_next_by_the_plate():
    upright = Pose(np.zeros(3), np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]))
    normal, held = np.array([0.0, 0.0, 1.0]), InHandTip(math.radians(2.0), 0.05, 3.0)
    once = Aim(InHandTip(0.0, 0.05, 0.0), normal).freed(held, upright, normal)
    assert once.in_hand is held
    assert once.direction @ normal == pytest.approx(math.cos(held.theta))
    assert once.freed(held, upright, normal).direction is normal


@pytest.mark.parametrize(
    ("short", "times"), [(OPEN_TOLERANCE + 1e-6, 1.0), (OPEN_TOLERANCE - 1e-6, 2.0), (-0.003, 2.0)]
)
def test_a_peg_at_the_bottom_is_given_twice_the_time_of_one_that_stalls_above_it(short, times):
    assert given_up_after(0.02 - short, 0.02, PARAMS) == times * PARAMS.stall_timeout


@pytest.mark.parametrize("most_deep", [CLOSED_TOLERANCE, 0.009])
def test_fingers_that_slide_down_the_peg_are_noticed_below_the_bottom(tmp_path, most_deep):
    """The hand of the fakes sinks as it is told, as fingers do that slide; the switch stays open."""
    rig = Rig(load(), tmp_path)
    ctx = rig.cell.context(1)
    hole = ctx.job.hole
    rig.gripper.grip(30.0)
    rig.arm.tcp = Pose(np.array([*hole.centre[:2], hole.centre[2] + ctx.length]), HAND_DOWN)
    ended = run(PARAMS.model_copy(update={"push_offset": 1e-3, "most_deep": most_deep}), ctx)
    assert (ended.outcome, ended.reason) == (Outcome.FAILURE, Reason.NOT_SEATED)
    assert ended.depth == pytest.approx(hole.depth + most_deep, abs=2e-3)


@pytest.mark.parametrize(("above", "goes_on"), [(-1e-3, True), (1e-3, False)])
def test_a_peg_that_hangs_above_the_plate_is_given_up_at_once(tmp_path, above, goes_on):
    """The hand of the fakes rests where it is put, above the height at which the rim of a leaning peg could still touch the plate, or below it."""
    rig = Rig(load(), tmp_path)
    ctx = rig.cell.context(1)
    rig.gripper.grip(30.0)
    height = ctx.job.hole.centre[2] + ctx.length + ctx.job.peg.part.inscribed / 2.0 + RAISED + above
    rig.arm.tcp = Pose(np.array([*ctx.job.hole.centre[:2], height]), HAND_DOWN)
    ended = run(PARAMS.model_copy(update={"push_offset": 0.0, "timeout": 0.5}), ctx)
    assert ended.reason is Reason.NOT_SEATED
    assert (ended.elapsed > 0.4) == goes_on


@pytest.mark.parametrize("feeds_forward", [True, False])
def test_the_spiral_is_fed_forward_where_it_is_asked_for(tmp_path, feeds_forward):
    """The hand of the fakes rests at the surface, so that the spiral goes on."""
    rig = Rig(load(), tmp_path)
    ctx = rig.cell.context(1)
    rig.gripper.grip(30.0)
    rig.arm.tcp = Pose(np.array([*ctx.job.hole.centre[:2], ctx.job.hole.centre[2] + ctx.length]), HAND_DOWN)
    run(PARAMS.model_copy(update={"push_offset": 0.0, "timeout": 0.5, "feeds_forward": feeds_forward}), ctx)
    assert ctx.held is not None
    assert (ctx.held.twist is not None) == feeds_forward


def test_ways_down_of_earlier_attempts_are_handed_on_while_the_peg_is_held(tmp_path):
    rig = Rig(load(sets=("hole.latch={kind='detent',force=5.0,height=0.003}", "hole.evidence=force")), tmp_path)
    ctx, way = rig.cell.context(1), way_down()
    ctx.ways = (way,)
    rig.gripper.grip(30.0)
    rig.arm.tcp = Pose(np.array([*ctx.job.hole.centre[:2], ctx.job.hole.centre[2] + ctx.length]), HAND_DOWN)
    run(PARAMS.model_copy(update={"push_offset": 0.0, "timeout": 0.5}), ctx)
    assert ctx.ways == (way,)


def swept(tilt, last=None, elapsed=1.0):
    """Return the tilt sweep of a hand that points down and closes along x, by a peg that may lean by `tilt`, rad."""
    tcp = Pose(np.zeros(3), np.column_stack([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]))
    return (last or TiltSweep()).next(elapsed, tcp, tilt, 0.05)


def test_a_tilt_sweep_turns_the_hand_about_its_closing_axis_to_both_sides_by_what_the_walls_allow_and_a_little_more():
    sweep, times = swept(0.02), 1.0 + np.linspace(0.0, PARAMS.sweep_time, 41)
    places = np.array([sweep.offset(time, PARAMS) for time in times])
    widest = 0.05 * (0.02 + SWEPT_BEYOND)
    np.testing.assert_allclose(places[:, 0], 0.0, atol=1e-15)
    assert (places[:, 1].min(), places[:, 1].max()) == pytest.approx((-widest, widest))
    assert (places[0, 1], places[20, 1], places[-1, 1]) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


def test_the_next_tilt_sweep_begins_to_the_other_side_and_none_is_wider_than_the_widest():
    first = swept(1.0)
    second = swept(1.0, first, elapsed=3.0)
    assert abs(first.amplitude) == pytest.approx(0.05 * MOST_SWEPT)
    assert second.amplitude == -first.amplitude


def test_a_tilt_sweep_lasts_as_long_as_the_recipe_says_and_the_published_adjustment_has_none():
    sweep = swept(0.02)
    assert (sweep.is_on(1.0 + 0.99 * PARAMS.sweep_time, PARAMS), sweep.is_on(1.01 + PARAMS.sweep_time, PARAMS)) == (
        True,
        False,
    )
    published = load(sets=["preset=paper"]).cell.params(ADJUST)
    assert not sweep.is_on(1.0, published)


def test_an_aim_that_is_kept_leaves_the_hand_as_it_is_turned():
    aim, tcp = Aim(InHandTip(0.1, 0.05, 0.0), np.array([0.0, 0.0, 1.0])), Pose(np.zeros(3), HAND_DOWN)
    _, axis = end_point(tcp, 0.1, 0.05)
    np.testing.assert_allclose(aim.kept(tcp).axis(np.zeros(2)), axis, atol=1e-12)
