"""The decisions of the adjustment, each by itself."""

import itertools
import math
from functools import partial

import numpy as np
import pytest

from cell.config.load import load
from cell.config.margins import inertias
from drivers.arm.dynamics import critical_damping
from drivers.errors import SwitchDisagreesError
from drivers.frames import UP, angle_between, end_point, rotation_about
from drivers.quantities import ArmState, Pose, SwitchState, Wrench
from skills.catalogue import ADJUST
from skills.contract import Outcome, Reason
from skills.held_peg import HeldPeg
from skills.insert.guided_peg import Descent, Guide, Stall, TiltSweep
from skills.insert.play import allowed_tilt
from skills.insert.spiral_adjust import ARRIVING, Swing, given_up_after, run
from skills.motion import anchored, tilted_by
from skills.paths import dither
from skills.search.surface import Plane
from skills.seating.decision import BORNE_FOR, CLOSED_TOLERANCE, OPEN_TOLERANCE
from skills.seating.latch_likelihood import SHEAR, resistance
from tests.fakes import HAND_DOWN, Rig
from tests.scripted import CELL, HOLE, LIGHT, SIDE, hand
from tests.unit.skills.benches import SkillBench
from tests.unit.skills.seating.test_latch import way_down

PARAMS = load().cell.params(ADJUST)
PERIOD, LEAST = PARAMS.dither_period, PARAMS.jammed
ABOUT = np.array([0.0, 1.0, 0.0])


def test_less_than_the_least_gain_and_another_theta_are_no_gain():
    stall = Stall().after(1e-3, 1.0, LEAST)
    assert stall.after(1e-3 + LEAST, 2.0, LEAST) == stall
    assert stall.after(1e-3 + 1.01 * LEAST, 2.0, LEAST).since == 2.0
    anew = Stall(deepest=2e-3, since=1.0).measured_anew(depth=2.5e-3, before=1.9e-3)
    assert (anew.deepest, anew.since) == (pytest.approx(2.6e-3), 1.0)


@pytest.mark.parametrize(
    ("gain", "is_jammed"), [(0.0, True), (0.99 * PARAMS.creep, True), (1.01 * PARAMS.creep, False)]
)
def test_a_period_in_which_the_peg_creeps_is_a_jam(gain, is_jammed):
    guide = Guide(began=1.0, reached=5e-3)
    assert not guide.after(5e-3, 1.0 + 0.99 * PERIOD, PARAMS).is_jammed
    assert guide.after(5e-3 + gain * LEAST, 1.0 + 1.01 * PERIOD, PARAMS).is_jammed is is_jammed


def test_each_period_is_judged_once_by_its_own_gain():
    guide = Guide(began=1.0, reached=5e-3)
    jams, depth = [], 5e-3
    for scan in range(1, round(4 * PERIOD / 0.01) + 2):
        depth += 2.0 * PARAMS.creep * LEAST * 0.01 / PERIOD if scan * 0.01 < 2 * PERIOD else 0.0
        guide = guide.after(depth, 1.0 + scan * 0.01, PARAMS)
        if guide.is_jammed:
            jams.append(scan * 0.01 / PERIOD)
    assert jams == pytest.approx([3.0, 4.0], abs=0.03)


def test_a_peg_that_slides_is_not_dithered_and_one_that_rests_is():
    resting = sliding = Descent(0.0)
    for scan in range(1, 31):
        resting = resting.after(0.0, 0.01, PARAMS)
        sliding = sliding.after(1.01 * PARAMS.sliding * 0.01 * scan, 0.01, PARAMS)
    rests = resting.rest(PARAMS), sliding.rest(PARAMS)
    sizes = [float(np.linalg.norm(Guide(began=0.0).offset(0.2 * PERIOD, PARAMS, rest))) for rest in rests]
    assert sizes == pytest.approx([0.8 * PARAMS.dither_radius, 0.0], abs=0.25 * PARAMS.dither_radius)
    assert (sizes[1], Descent(5e-3).after(4e-3, 0.01, PARAMS).rest(PARAMS)) == (0.0, 1.0)


def turning(rate, stamps):
    """Return the swing of a hand that turns at `rate`, rad/s, in states of the arm at these times, s."""
    swing = Swing(HAND_DOWN[:, 0], float(stamps[0]))
    for stamp in stamps:
        tcp = Pose(np.zeros(3), rotation_about(ABOUT, rate * stamp) @ HAND_DOWN)
        state = ArmState(stamp, np.zeros(7), np.zeros(7), tcp, Wrench(np.zeros(3), np.zeros(3)), 2, 0.0)
        swing = swing.after(state, PARAMS)
    return swing


@pytest.mark.parametrize("stamps", [np.arange(0.0, 0.3, 0.01), np.arange(0.0, 1.2, 0.1)])
def test_the_swing_is_the_turning_rate_at_any_scan_rate(stamps):
    assert turning(0.7, stamps).rate == pytest.approx(0.7, rel=0.01)
    assert turning(0.7, np.repeat(stamps, 2)).rate == turning(0.7, stamps).rate


def test_a_fast_turning_hand_lets_the_peg_down_gently():
    dithered = Swing(ABOUT, 0.0, PARAMS.dither_rate * PARAMS.dither_radius / load().cell.peg.length)
    slow, fast = (Swing(ABOUT, 0.0, rate) for rate in (0.5, 1.0))
    assert (dithered.damping(PARAMS), dithered.push(PARAMS)) == (1.0, 1.0)
    assert 1.0 < slow.damping(PARAMS) < fast.damping(PARAMS) == PARAMS.most_swing_damping
    assert 1.0 > slow.push(PARAMS) > fast.push(PARAMS) > 0.3


@pytest.mark.parametrize("preset", ["", "careful"])
def test_the_damping_of_a_swing_is_stable_with_late_torques(preset):
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
    stiffness[2], ratios[2] = params.push_stiffness, PARAMS.most_swing_damping * params.push_damping_ratio
    for inertia in inertias(cell.place())[1:]:  # the peg is upright
        damping = np.sqrt(np.outer(ratios, ratios)) * critical_damping(inertia, stiffness)
        rates = np.abs(np.linalg.eigvals(np.linalg.solve(inertia, damping)))
        assert 1.2 * rates.max() < low * math.hypot(1.0, low * lag)


@pytest.mark.parametrize(
    ("short", "is_down"), [(OPEN_TOLERANCE + 1e-6, False), (OPEN_TOLERANCE - 1e-6, True), (-0.003, True)]
)
def test_a_peg_at_the_bottom_is_given_up_later(short, is_down):
    assert given_up_after(0.02 - short, 0.02, PARAMS) == (PARAMS.stall_at_bottom if is_down else PARAMS.stall_timeout)


@pytest.mark.parametrize(("above", "goes_on"), [(-1e-3, True), (1e-3, False)])
def test_a_peg_that_hangs_above_the_plate_is_given_up_at_once(bench, above, goes_on):
    """At the height up to which the rim of a leaning peg could still touch the plate, or above it."""
    height = CELL.peg.part.inscribed / 2.0 + PARAMS.raised + above
    bench.way = lambda time: hand(HOLE + height * UP)
    ended = bench.run()
    assert (ended.reason, ended.elapsed > 0.4) == (Reason.NOT_SEATED, goes_on)


@pytest.mark.parametrize(("lean", "goes_on"), [(PARAMS.leaning - 0.02, True), (PARAMS.leaning + 0.02, False)])
def test_a_leaning_peg_is_given_up_at_once(bench, lean, goes_on):
    bench.way = lambda time: hand(HOLE, lean)
    ended = bench.run()
    assert (ended.reason, ended.elapsed > 0.4) == (Reason.NOT_SEATED if goes_on else Reason.NOT_ALIGNED, goes_on)


def test_strokes_of_earlier_attempts_are_kept_while_the_peg_is_held(make):
    bench, way = make("hole.latch={kind='detent',force=5.0,height=0.003}", "hole.evidence=force"), way_down()
    bench.ctx.peg = HeldPeg(ways=(way,))
    bench.run(push_offset=0.0)
    assert bench.ctx.peg.ways == (way,)


def test_a_tilt_sweep_goes_a_little_beyond_what_the_walls_allow():
    """About the closing axis; the next one begins to the other side. The hand points down and closes along x."""
    tcp = Pose(np.zeros(3), np.column_stack([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]))
    sweep, times = TiltSweep().next(1.0, tcp, 0.02, 0.05, PARAMS), 1.0 + np.linspace(0.0, PARAMS.sweep_time, 41)
    places = np.array([sweep.offset(time, PARAMS) for time in times])
    widest = 0.05 * (0.02 + PARAMS.swept_beyond)
    np.testing.assert_allclose(places[:, 0], 0.0, atol=1e-15)
    assert (places[:, 1].min(), places[:, 1].max()) == pytest.approx((-widest, widest))
    assert (places[0, 1], places[20, 1], places[-1, 1]) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert [sweep.is_on(1.0 + share * PARAMS.sweep_time, PARAMS) for share in (0.99, 1.01)] == [True, False]
    assert sweep.next(3.0, tcp, 1.0, 0.05, PARAMS).amplitude == pytest.approx(
        -np.sign(sweep.amplitude) * 0.05 * PARAMS.most_swept
    )


@pytest.fixture
def make(tmp_path):
    """Return what makes a bench whose peg stands upright at the hole's mouth by default."""
    return lambda *sets: SkillBench(Rig(load(sets=[LIGHT, *sets]), tmp_path), run, PARAMS, lambda time: hand())


@pytest.fixture
def bench(make):
    return make()


def at_depth(depth):
    """Return a way that stays at this depth, m."""
    return lambda time: hand(HOLE - depth * UP)


def test_the_setpoint_follows_a_tip_that_the_hole_guides(bench):
    bench.way = lambda time: hand(HOLE - 2e-3 * UP + min(0.02 * time, 0.01) * SIDE)
    bench.run(jammed=1e-12, dither_period=10.0)
    for seen, setpoint in bench.scans():
        np.testing.assert_allclose(setpoint.tip[:2], anchored(seen.tip, bench.seen[0].tip)[:2], atol=1e-12)
        offset = dither(seen.running, PARAMS.dither_radius, PARAMS.dither_rate, 10.0)
        np.testing.assert_allclose(setpoint.axis, tilted_by(offset, CELL.peg.length), atol=1e-12)
    assert bench.commanded[-1].tip[0] - HOLE[0] == pytest.approx(4e-3)
    for before, after in itertools.pairwise(bench.commanded):
        np.testing.assert_allclose(before.twist.angular, np.cross(before.axis, after.axis) / 0.01, atol=1e-9)


@pytest.mark.parametrize("turns_freely", [False, True])
def test_the_yaw_of_the_hand_gives_way_only_between_walls(bench, turns_freely):
    bench.way = lambda time: Pose(hand().position, rotation_about(UP, 0.2 * time) @ hand().rotation)
    bench.skill = partial(run, turns_freely=turns_freely)
    bench.run()
    for seen, setpoint in bench.scans():
        np.testing.assert_array_equal(setpoint.roll, (seen if turns_freely else bench.seen[0]).arm.tcp.rotation[:, 2])


@pytest.mark.parametrize(("short", "factor"), [(1e-5, 1.0), (-1e-5, ARRIVING)])
def test_a_peg_is_let_down_to_the_bottom_more_gently(bench, short, factor):
    bench.way = at_depth(CELL.hole.depth - PARAMS.arrival - short)
    bench.run(timeout=0.05)
    assert bench.commanded[-1].damping_ratio[2] == pytest.approx(factor * PARAMS.push_damping_ratio)


def test_a_swinging_hand_pushes_less_and_damps_more(bench):
    rate = 0.5
    bench.way = lambda time: hand(tilt=rate * time)
    bench.run(swing_time=0.3)
    swing = Swing(SIDE, 0.0, rate)
    scans = list(bench.scans())
    for (seen, setpoint), expected in ((scans[25], swing), (scans[40], Swing(SIDE, 0.0, 0.0))):
        tip = end_point(seen.arm.tcp, 0.0, CELL.peg.length)[0]
        assert tip[2] - setpoint.tip[2] == pytest.approx(PARAMS.push_offset * expected.push(PARAMS), rel=1e-3)
        damping = PARAMS.push_damping_ratio * expected.damping(PARAMS)
        assert setpoint.damping_ratio[2] == pytest.approx(damping, rel=1e-3)


@pytest.mark.parametrize(("felt_short", "waits"), [(0.5e-3, False), (1.5e-3, True), (-3e-3, True)])
def test_a_doubtful_depth_is_proved_by_the_bottom(bench, felt_short, waits):
    bench.way = at_depth(CELL.hole.depth)
    bench.rig.at(0.05, lambda: setattr(bench.rig.switch, "state", SwitchState.CLOSED))
    ended = bench.run(Plane(HOLE - felt_short * UP, UP))
    assert ended.outcome is Outcome.SUCCESS
    assert ended.elapsed == pytest.approx(0.05 + (BORNE_FOR if waits else 0.0), abs=1.1e-2)


def test_a_stalled_peg_is_given_up_after_the_stall_timeout(bench):
    bench.way = lambda time: hand(HOLE - min(0.01 * time, 1e-3) * UP)
    ended = bench.run(stall_timeout=0.2, timeout=2.0)
    assert (ended.outcome, ended.reason) == (Outcome.FAILURE, Reason.NOT_SEATED)
    assert (ended.elapsed, ended.depth) == pytest.approx((0.3, 1e-3), abs=2.5e-2)


def test_an_open_switch_at_the_bottom_disagrees_with_the_depth(bench):
    bench.way = at_depth(CELL.hole.depth)
    with pytest.raises(SwitchDisagreesError):
        bench.run(stall_timeout=0.1, stall_at_bottom=0.2, timeout=2.0)
    assert bench.rig.clock.now() == pytest.approx(0.2, abs=3e-2)


def test_a_peg_below_the_bottom_is_given_up_at_once(bench):
    bench.way = at_depth(CELL.hole.depth + CLOSED_TOLERANCE + 1e-5)
    ended = bench.run()
    assert (ended.reason, ended.elapsed) == (Reason.NOT_SEATED, 0.0)


def test_a_jammed_peg_is_aimed_anew_and_swept(bench):
    """The first period of the dither ends in the 41st scan, without a gain."""
    bench.way = at_depth(1.5e-3)
    bench.turn(0.1, 0.03)
    bench.run(dither_period=0.4, sweep_time=0.5, timeout=0.8)
    before, after = bench.commanded[39], bench.commanded[42]
    assert (before.in_hand.theta, after.in_hand.theta) == (0.0, 0.03)
    resting = end_point(hand(), 0.03, CELL.peg.length)[1]
    # From now on the finger centre swings about the axis along which the peg rests, across the closing axis.
    widest = max(angle_between(each.axis, resting) for each in bench.commanded[41:])
    allowed = allowed_tilt(1.5e-3, CELL.peg.part.thickness, CELL.hole.part.thickness) + PARAMS.swept_beyond
    assert widest == pytest.approx(min(allowed, PARAMS.most_swept), rel=0.02)
    # The depth is that of the tip by the theta that was read, and is no gain.
    tip = end_point(hand(HOLE - 1.5e-3 * UP), 0.03, CELL.peg.length)[0]
    assert after.tip[2] == pytest.approx(tip[2] - PARAMS.push_offset)


def test_after_a_second_jam_the_push_is_along_the_normal(bench):
    """The first sweep begins after a period of 0.2 s and takes as long; the dither begins anew after it."""
    bench.way = lambda time: hand(HOLE - 1.5e-3 * UP, tilt=0.02)
    bench.run(dither_period=0.2, sweep_time=0.2, timeout=0.85, dither_radius=1e-9)
    resting = end_point(hand(tilt=0.02), 0.0, CELL.peg.length)[1]
    between, second = bench.commanded[42:57], bench.commanded[59:79]
    assert max(angle_between(each.axis, resting) for each in between) < 1e-3
    # A sweep goes to both sides of what the peg is pushed along, and the second one first to the other side.
    assert angle_between(np.mean([each.axis for each in second], axis=0), UP) < 3e-3
    assert bench.commanded[25].axis[0] == pytest.approx(-PARAMS.most_swept, rel=0.02)
    assert bench.commanded[64].axis[0] == pytest.approx(PARAMS.most_swept, rel=0.02)


@pytest.mark.parametrize("worn", [False, True])
def test_a_felt_latch_seats_a_peg_without_a_switch(make, worn):
    """The hand goes down at an even speed, and is drawn up if the peg's latch was not felt."""
    bench = make("hole.evidence=force", "hole.latch={kind='detent',force=5.0,height=0.003}")
    rig, latch = bench.rig, bench.rig.cell.config.hole.latch
    rig.switch.state = SwitchState.UNKNOWN

    def way(time):
        above = max(0.008 - 0.02 * time, 0.0)
        force = 8.0 if above == 0.0 else float(resistance(np.array(above), latch)) * (not worn)
        rig.arm.force = force * UP
        return hand(HOLE - (CELL.hole.depth - above + SHEAR * force) * UP)

    bench.way = way
    ended = bench.run(timeout=1.5)
    assert (ended.outcome is Outcome.SUCCESS) != worn
    pulled = max(each.tip[2] - seen.tip[2] for seen, each in zip(bench.seen, bench.commanded, strict=False))
    assert (pulled > 0.0) == worn


def test_a_swept_peg_that_slides_is_left_as_it_is_turned(bench):
    """The peg goes down at 0.1 m/s once the sweep has turned the hand."""
    bench.way = lambda time: hand(HOLE - (1.5e-3 + max(0.1 * (time - 0.55), 0.0)) * UP, tilt=0.02)
    bench.run(dither_period=0.4, sweep_time=0.5, timeout=0.7)
    last, resting = bench.commanded[-1], end_point(hand(tilt=0.02), 0.0, CELL.peg.length)[1]
    np.testing.assert_allclose(last.axis, resting, atol=1e-3)
