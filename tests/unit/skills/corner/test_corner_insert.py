"""Setpoints of the insertion of a peg with corners, scan by scan, and its endings; the hand is where the test puts it."""

import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from drivers.frames import UP, angle_between, rotation_about, rotation_by
from skills.catalogue import SEARCH
from skills.contract import Outcome, Reason
from skills.corner.insert import left_to_raise, raise_from, run, sweep_of, to_and_fro
from skills.paths import dither
from skills.search.surface import Plane
from tests.fakes import PERIOD, Rig
from tests.scripted import HOLE, SQUARE, corner_hand
from tests.unit.skills.benches import SkillBench, corner_axes

CELL, PARAMS = SQUARE.cell, SQUARE.cell.corner.insert


def test_turns_to_either_side_grow_up_to_their_reach() -> None:
    rate, growth, reach = 0.25, 0.035, 0.1
    angles = np.array([to_and_fro(t, rate, growth, reach) for t in np.arange(0.0, 12.0, 0.01)])
    assert angles[0] == 0.0
    assert np.abs(np.diff(angles)).max() == pytest.approx(rate * 0.01)
    assert (angles.max(), angles.min()) == (pytest.approx(reach, abs=3e-3), pytest.approx(-reach, abs=3e-3))
    ends = angles[1:-1][np.diff(np.sign(np.diff(angles))) != 0]
    np.testing.assert_allclose(ends[:4], [0.035, -0.07, 0.1, -0.1], atol=3e-3)


def test_each_attempt_sweeps_about_its_own_middle() -> None:
    cell, most = CELL, math.radians(10.0)
    sweeps = [sweep_of(cell.plan(attempt).corner.insert, most) for attempt in range(4)]
    assert [sweep.centre for sweep in sweeps] == pytest.approx([0.0, 0.6 * most, -0.6 * most, 0.0])
    params = cell.corner.insert
    assert sweep_of(params, 0.0).reach == pytest.approx(params.felt + params.margin)


def test_the_first_sweep_covers_every_yaw_of_the_hole_in_time() -> None:
    cell, most = CELL, math.radians(10.0)
    for attempt in range(3):
        params = cell.plan(attempt).corner.insert
        sweep = sweep_of(params, most)
        yaws = [sweep.yaw(time, 1.5, params) for time in np.arange(1.5, params.timeout, 0.01)]
        assert max(np.abs(yaws)) <= most + params.margin
        assert attempt > 0 or (min(yaws) < -most and max(yaws) > most)


@pytest.mark.parametrize("stop", [0.0, 0.3])
@pytest.mark.parametrize("tilt", [0.05, 0.5])
def test_a_peg_goes_from_its_lean_to_its_tilt(tilt: float, stop: float) -> None:
    params = CELL.corner.insert.model_copy(update={"raise_stop": stop})
    axis, closing = CELL.peg.part.leaning(0.0, tilt)
    hand = np.column_stack([-axis, np.cross(closing, -axis), closing])
    seen = SimpleNamespace(axis=axis, arm=SimpleNamespace(tcp=SimpleNamespace(rotation=hand)))
    way = raise_from(seen, UP, params)
    lefts = [left_to_raise(params, way, time) for time in np.linspace(0.0, way.risen, 20)]
    leans = [angle_between(UP, rotation_about(way.about, left) @ way.axis) for left in lefts]
    assert (leans[0], leans[-1]) == pytest.approx((tilt, params.tilt))
    assert np.all(np.diff(leans) * (params.tilt - tilt) >= -1e-12)


def test_a_search_with_a_corner_has_the_keys_of_its_section() -> None:
    corner = CELL.corner
    stated = CELL.params(SEARCH).model_copy(update={"fast_axis": "y", "tilt_azimuth": 0.0})
    search = corner.searching(stated)
    own = {key: getattr(corner, key) for key in ("tilt", "speed", "pitch", "dip_threshold", "lag", "fall")}
    assert search == stated.model_copy(update={**own, "fast_axis": "x", "is_doubtful": True})
    assert all(getattr(stated, key) != value for key, value in own.items())


@pytest.mark.parametrize(
    ("azimuth", "fast"), [(0.0, "x"), (0.78, "x"), (0.79, "y"), (2.35, "y"), (2.36, "x"), (-0.79, "y"), (-3.0, "x")]
)
def test_a_peg_with_corners_is_swept_along_the_nearest_axis(azimuth: float, fast: str) -> None:
    stated = CELL.params(SEARCH).model_copy(update={"tilt_azimuth": azimuth})
    assert CELL.corner.searching(stated).fast_axis == fast


LENGTH = CELL.peg.length
LEAN, DIRECTION = 0.5, 0.3
"""Lean of a peg that the search has left in the hole's mouth, and azimuth of the hand's closing axis, rad."""
CORNER = np.array([math.cos(DIRECTION + math.pi / 4), math.sin(DIRECTION + math.pi / 4), 0.0])
"""Direction in the plate towards the corner over which it leans."""
DOWN = np.cross(CORNER, UP)
"""Axis about which it is raised."""
RISEN = (LEAN - PARAMS.tilt) / PARAMS.raise_rate + PARAMS.raise_stop / 2.0
SETTLED = RISEN + PARAMS.settle
"""Time at which it is raised, and has settled, s."""
UNFELT = {"felt": 1.0, "sunk": 1.0, "strayed": 1.0}
"""Parameters with which nothing ends the sweep."""


def hand(tip=HOLE, tilt=LEAN, **turns):
    """Return the hand whose peg leans over its corner."""
    return corner_hand(tip, tilt, DIRECTION, **turns)


def raised(time, tip=HOLE, yaw=0.0):
    """Return the hand whose peg is raised in good time."""
    return hand(tip, LEAN if time < RISEN else PARAMS.tilt, yaw=yaw)


def left_at(time):
    """Return by how much the setpoint is still to be raised, rad: at a constant rate that fades to nothing within the stop."""
    stop, rate = PARAMS.raise_stop, PARAMS.raise_rate
    if time <= RISEN - stop:
        return LEAN - PARAMS.tilt - rate * time
    return rate * max(RISEN - time, 0.0) ** 2 / (2.0 * stop)


def swept(time, reach=1.0):
    """Return the yaw of the sweep, rad, which begins once the peg has settled."""
    return to_and_fro(max(time - SETTLED, 0.0), PARAMS.turn_rate, PARAMS.growth, reach)


@pytest.fixture
def bench(tmp_path):
    return SkillBench(Rig(SQUARE, tmp_path), run, PARAMS, lambda time: hand())


def centred(attempt):
    """Return the parameters of an attempt that nothing ends."""
    return {"centre": PARAMS.centres[attempt], "timeout": 2.0, **UNFELT}


@pytest.mark.parametrize("attempt", [0, 1])
def test_the_hand_is_raised_over_its_corner_and_then_sweeps(bench, attempt):
    centre = PARAMS.centres[attempt] * CELL.hole.yaw
    bench.run(dither_radius=0.0, **centred(attempt))
    axis, closing = bench.seen[0].axis, bench.seen[0].arm.tcp.rotation[:, 2]
    for seen, setpoint in bench.scans():
        time = seen.running
        yaw = centre * min(time / SETTLED, 1.0) + swept(time, 1.0 + PARAMS.margin)
        turned = rotation_about(UP, yaw) @ rotation_about(DOWN, LEAN - PARAMS.tilt - left_at(time))
        np.testing.assert_allclose(setpoint.axis, turned @ axis, atol=1e-9)
        np.testing.assert_allclose(setpoint.roll, turned @ closing, atol=1e-9)
    assert angle_between(setpoint.axis, UP) == pytest.approx(PARAMS.tilt)
    assert yaw != centre


def test_the_finger_centre_is_dithered_once_the_peg_has_settled(bench):
    bench.run(dither_radius=1e-3, dither_period=0.3, turn_rate=1e-9, **centred(0))
    raised_axis = math.cos(PARAMS.tilt) * UP + math.sin(PARAMS.tilt) * CORNER
    dithered = [(seen.running - SETTLED, at.axis) for seen, at in bench.scans() if seen.running > SETTLED]
    for time, axis in dithered:
        offset = dither(time, 1e-3, PARAMS.dither_rate, 0.3)
        np.testing.assert_allclose(LENGTH * (axis - raised_axis)[:2], offset, atol=1e-5)
    assert len(dithered) > 80


@pytest.mark.parametrize("attempt", [0, 2])
def test_the_motion_of_the_setpoint_is_fed_forward(bench, attempt):
    bench.run(**centred(attempt))
    for before, after in pairwise(bench.commanded):
        turn = rotation_by(PERIOD * before.twist.angular)
        np.testing.assert_allclose(turn @ before.axis, after.axis, atol=1e-5)
        np.testing.assert_allclose(turn @ before.roll, after.roll, atol=1e-5)
        np.testing.assert_array_equal(before.twist.linear, np.zeros(3))


@pytest.mark.parametrize("is_turned_round", [False, True])
@pytest.mark.parametrize(("press", "pressed"), [(3e-3, 3e-3), (5e-4, 1e-3)])
def test_the_tip_is_led_into_the_corner_and_pressed(bench, is_turned_round, press, pressed):
    lead, offset, way = (1e-3, 2.5e-3), 7e-3, np.array([1e-3, -1e-3, 2e-4])
    bench.way = lambda time: hand(HOLE + time * way, is_turned_round=is_turned_round)
    bench.run(lead=lead, press=press, push_offset=offset, **centred(1))
    centre = PARAMS.centres[1] * CELL.hole.yaw
    closing = rotation_about(DOWN, LEAN - PARAMS.tilt) @ bench.seen[0].arm.tcp.rotation[:, 2]
    along, across = corner_axes(closing, CORNER)
    for seen, setpoint in bench.scans():
        time = seen.running
        turn = rotation_about(UP, centre * min(time / SETTLED, 1.0) + swept(time))
        share = min(max((time - RISEN) / PARAMS.settle, 0.0), 1.0)
        led = ((1.0 - share) * lead[0] + share * pressed) * along + lead[1] * across
        np.testing.assert_allclose(setpoint.tip, seen.tip + turn @ led - offset * UP, atol=1e-9)
    assert share == 1.0


def test_on_a_tilted_plate_all_of_it_goes_by_its_normal(bench):
    normal = rotation_about(np.array([0.6, -0.8, 0.0]), 0.05) @ UP
    bench.run(Plane(HOLE, normal), dither_radius=0.0, **centred(0))
    last, seen = bench.commanded[-1], bench.seen[-1]
    assert angle_between(last.axis, normal) == pytest.approx(PARAMS.tilt)
    assert (seen.tip - last.tip) @ normal == pytest.approx(PARAMS.push_offset)


def test_the_push_is_weaker_until_the_peg_is_raised_and_has_settled(bench):
    bench.run(push_stiffness=400.0, push_back=0.7, **centred(0))
    for seen, setpoint in bench.scans():
        assert setpoint.stiffness[2] == 400.0 * (0.7 if seen.running < SETTLED else 1.0)
    assert seen.running > SETTLED


@pytest.mark.parametrize("yaw_rate", [0.0, 0.1, -0.1])
def test_a_wall_is_felt_where_the_hand_lags_behind_the_sweep(bench, yaw_rate):
    bench.way = lambda time: raised(time, yaw=yaw_rate * max(time - SETTLED, 0.0))
    ended = bench.run(timeout=2.0, growth=0.3, yaw_sweep=3.0)
    sweeping = PARAMS.felt / (PARAMS.turn_rate - yaw_rate)
    assert (ended.outcome, ended.reason) == (Outcome.SUCCESS, Reason.NONE)
    assert ended.elapsed == pytest.approx(SETTLED + sweeping, abs=1.5 * PERIOD)
    assert ended.yaw == pytest.approx(sweeping * PARAMS.turn_rate, abs=1.5 * PERIOD * PARAMS.turn_rate)
    assert ended.phi == pytest.approx(PARAMS.tilt)


def test_a_lag_while_the_peg_is_raised_is_no_wall(bench):
    bench.way = raised
    ended = bench.run(timeout=2.0, centre=PARAMS.centres[1])
    assert PARAMS.centres[1] * CELL.hole.yaw > PARAMS.felt
    assert (ended.outcome, ended.elapsed) == (Outcome.SUCCESS, pytest.approx(SETTLED, abs=1.1 * PERIOD))


def test_a_hand_that_keeps_up_with_the_sweep_feels_no_wall(bench):
    bench.way = lambda time: raised(time, yaw=swept(time, 0.2))
    ended = bench.run(timeout=2.0)
    assert (ended.outcome, ended.reason, ended.elapsed) == (Outcome.FAILURE, Reason.NOT_ALIGNED, 2.0)
    assert (ended.yaw, ended.phi) == pytest.approx((swept(1.99, 0.2), PARAMS.tilt), abs=1e-6)


@pytest.mark.parametrize(("more", "has_sunk"), [(1e-6, True), (-1e-6, False)])
def test_a_tip_that_sinks_in_the_sweep_has_dropped_in(bench, more, has_sunk):
    def height(time):
        """A peg that climbs by 0.3 mm in the sweep, and had stood higher before it, drops."""
        if time < SETTLED:
            return 2e-3
        return 0.3e-3 - (0.0 if time < 1.4 - 1e-9 else PARAMS.sunk + more)

    bench.way = lambda time: raised(time, HOLE + height(time) * UP)
    ended = bench.run(timeout=2.0, felt=1.0)
    assert ended.outcome is (Outcome.SUCCESS if has_sunk else Outcome.FAILURE)
    assert ended.elapsed == pytest.approx(1.4 if has_sunk else 2.0, abs=1e-9)


@pytest.mark.parametrize(("share", "has_strayed"), [(1.01, True), (0.99, False)])
@pytest.mark.parametrize("way", [CORNER, UP])
def test_a_tip_that_strays_in_the_sweep_has_left_the_hole(bench, share, has_strayed, way):
    def strayed(time):
        return 2e-3 if time < SETTLED else 0.0 if time < 1.4 - 1e-9 else share * PARAMS.strayed

    bench.way = lambda time: raised(time, HOLE + strayed(time) * way)
    ended = bench.run(timeout=2.0, felt=1.0, lost_height=1.0)
    assert (ended.outcome, ended.reason) == (Outcome.FAILURE, Reason.NOT_ALIGNED)
    assert ended.elapsed == pytest.approx(1.4 if has_strayed else 2.0, abs=1e-9)
    yaw = swept(1.4 if has_strayed else 1.99)
    assert (ended.yaw, ended.phi) == pytest.approx((yaw, PARAMS.tilt), abs=1e-6)
