"""A square peg's corner, and the turns that find how its hole is turned."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP, angle_between, rotation_about
from drivers.part.rectangular import Rectangular
from drivers.quantities import InHandTip
from skills.catalogue import SEARCH
from skills.corner.adjust import STRAYED_FOR, Entry, Watch
from skills.corner.insert import (
    Raised,
    YawSweep,
    lead_at,
    lead_to,
    left_to_raise,
    raise_from,
    sweep_of,
    tipped,
    to_and_fro,
    turned_by,
)

SIDE = 0.008
CELL = load().cell
SQUARE = Rectangular(SIDE, SIDE)


def test_a_peg_that_leans_over_its_corner_has_that_corner_ahead_and_lowest() -> None:
    axis, closing = SQUARE.leaning(0.2, 0.5)
    assert float(axis @ closing) == pytest.approx(0.0, abs=1e-15)
    corner = SQUARE.lowest(np.zeros(3), axis, closing)
    half = SIDE / math.sqrt(2)
    ahead = np.array([math.cos(0.2 + math.pi / 4), math.sin(0.2 + math.pi / 4)])
    np.testing.assert_allclose(corner, [*(half * math.cos(0.5) * ahead), -half * math.sin(0.5)], atol=1e-15)


def test_no_corner_lies_lower_than_the_lowest() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        turned = rotation_about(UP, rng.uniform(-3.0, 3.0)) @ rotation_about(
            np.array([1.0, 0.0, 0.0]), rng.uniform(0, 1)
        )
        axis, closing = turned[:, 2], turned[:, 0]
        beside = turned[:, 1]
        all_four = [SIDE / 2 * (a * closing + b * beside) for a in (-1, 1) for b in (-1, 1)]
        corner = SQUARE.lowest(np.zeros(3), axis, closing)
        assert corner[2] == pytest.approx(min(each[2] for each in all_four))
        assert min(np.linalg.norm(corner - each) for each in all_four) < 1e-15


def test_turns_go_to_either_side_further_each_time_and_never_beyond_their_reach() -> None:
    rate, growth, reach = 0.25, 0.035, 0.1
    angles = np.array([to_and_fro(t, rate, growth, reach) for t in np.arange(0.0, 12.0, 0.01)])
    assert angles[0] == 0.0
    assert np.abs(np.diff(angles)).max() == pytest.approx(rate * 0.01)
    assert (angles.max(), angles.min()) == (pytest.approx(reach, abs=3e-3), pytest.approx(-reach, abs=3e-3))
    ends = angles[1:-1][np.diff(np.sign(np.diff(angles))) != 0]
    np.testing.assert_allclose(ends[:4], [0.035, -0.07, 0.1, -0.1], atol=3e-3)


@pytest.mark.parametrize("angle", [-0.2, 0.0, 0.15])
def test_how_far_a_hand_has_turned_about_the_normal_does_not_depend_on_how_it_leans(angle: float) -> None:
    _, closing = SQUARE.leaning(0.3, 0.12)
    turned = rotation_about(UP, angle) @ closing
    assert turned_by(turned, closing, UP) == pytest.approx(angle)


def test_what_is_tipped_leans_towards_where_it_was_asked_to() -> None:
    np.testing.assert_allclose((tipped(np.array([0.01, -0.02])) @ UP)[:2], [0.01, -0.02], atol=1e-5)


def test_the_corner_is_led_to_its_own_side_along_the_closing_axis_and_across() -> None:
    lead = lead_to(np.array([1.0, 1.0, 0.0]) / math.sqrt(2), np.array([-1.0, 0.0, 0.1]), UP, (0.003, 0.002))
    np.testing.assert_allclose(lead, [0.003, 0.002, 0.0], atol=1e-15)


def test_a_sweep_measures_from_where_it_began_and_keeps_the_greatest_height() -> None:
    begun, up = np.array([0.5, 0.0, 0.1]), np.array([0.0, 0.0, 0.001])
    sweep = YawSweep(0.0, 0.1)
    assert sweep.distance(begun) == 0.0
    sweep = sweep.after(begun, 0.0).after(begun + up, -0.001).after(begun, 0.0005)
    assert sweep.distance(begun + 3.0 * up) == pytest.approx(0.003)
    assert sweep.highest == 0.001


def test_each_attempt_sweeps_about_its_own_middle_and_at_least_as_far_as_a_wall_is_felt() -> None:
    cell, most = load(sets=("peg.shape=square",)).cell, math.radians(10.0)
    sweeps = [sweep_of(cell.plan(attempt).corner.insert, most) for attempt in range(4)]
    assert [sweep.centre for sweep in sweeps] == pytest.approx([0.0, 0.6 * most, -0.6 * most, 0.0])
    params = cell.corner.insert
    assert sweep_of(params, 0.0).reach == pytest.approx(params.felt + params.margin)


def test_the_yaw_reaches_the_middle_of_its_sweep_when_the_peg_has_settled() -> None:
    params = load().cell.corner.insert
    sweep = YawSweep(0.1, 0.2)
    assert [sweep.yaw(time, 2.0, params) for time in (0.0, 1.0, 2.0)] == pytest.approx([0.0, 0.05, 0.1])
    assert sweep.yaw(2.0 + 0.02, 2.0, params) == pytest.approx(0.1 + 0.02 * params.turn_rate)


def test_the_first_sweep_covers_every_yaw_that_the_hole_can_have_within_its_timeout_and_no_sweep_goes_beyond() -> None:
    cell, most = load(sets=("peg.shape=square",)).cell, math.radians(10.0)
    for attempt in range(3):
        params = cell.plan(attempt).corner.insert
        sweep = sweep_of(params, most)
        yaws = [sweep.yaw(time, 1.5, params) for time in np.arange(1.5, params.timeout, 0.01)]
        assert max(np.abs(yaws)) <= most + params.margin
        assert attempt > 0 or (min(yaws) < -most and max(yaws) > most)


def entry(tilt: float = 0.12) -> Entry:
    axis, closing = SQUARE.leaning(0.0, tilt)
    return Entry(load().cell.corner.adjust, InHandTip(0.0, 0.05, 0.0), UP, axis, closing)


def test_an_entering_peg_leans_as_far_as_is_left_but_for_the_dither() -> None:
    start, play = entry(), load().cell.corner.adjust.dither_radius / 0.05
    for left in (0.12, 0.05, 0.0):
        tilts = [math.acos(start.axis_at(left, time)[2]) for time in np.arange(0.0, 0.5, 0.01)]
        np.testing.assert_allclose(tilts, left, atol=1.05 * play)


def test_an_entering_corner_stays_deeper_than_the_others_until_the_walls_have_the_peg() -> None:
    start, params = entry(), load().cell.corner.adjust
    assert start.raised(0.12, 0.0, 0.01) == pytest.approx(0.12 - 0.01 * params.raise_rate)
    assert start.raised(params.tilt, params.caught, 0.01) == params.tilt
    assert start.raised(params.tilt, 1.01 * params.caught, 0.01) < params.tilt
    assert start.raised(0.0, 0.0, 0.01) == 0.0


def test_an_entering_corner_is_led_towards_the_side_it_leans_to() -> None:
    along, across = load().cell.corner.adjust.lead
    np.testing.assert_allclose(entry().lead, [along, across, 0.0], atol=1e-2 * along)


def raised(tilt: float = 0.5) -> Raised:
    axis, closing = SQUARE.leaning(0.0, tilt)
    hand = np.column_stack([-axis, np.cross(closing, -axis), closing])
    seen = SimpleNamespace(axis=axis, arm=SimpleNamespace(tcp=SimpleNamespace(rotation=hand)))
    return raise_from(seen, UP, load().cell.corner.insert)


def test_a_peg_is_raised_at_its_rate_and_comes_to_a_stand_without_a_jump_of_it() -> None:
    params, way, step = load().cell.corner.insert, raised(), 1e-3
    left = [left_to_raise(params, way, time) for time in np.arange(0.0, way.risen + 0.1, step)]
    rates = -np.diff(left) / step
    assert (left[0], left[-1]) == (pytest.approx(way.swing), 0.0)
    assert rates.max() == pytest.approx(params.raise_rate)
    assert np.abs(np.diff(rates)).max() <= 1.01 * params.raise_rate / params.raise_stop * step
    assert way.risen == pytest.approx(way.swing / params.raise_rate + params.raise_stop / 2.0)


@pytest.mark.parametrize("tilt", [0.05, 0.5])
def test_a_peg_begins_where_it_leans_and_goes_to_its_tilt_from_either_side(tilt) -> None:
    params, way = load().cell.corner.insert, raised(tilt)
    leans = [
        angle_between(UP, rotation_about(way.about, left_to_raise(params, way, time)) @ way.axis)
        for time in np.linspace(0.0, way.risen, 20)
    ]
    assert (leans[0], leans[-1]) == pytest.approx((tilt, params.tilt))
    assert np.all(np.diff(leans) * (params.tilt - tilt) >= -1e-12)


def test_a_stop_of_no_time_ends_the_raise_at_once() -> None:
    params, way = load().cell.corner.insert.model_copy(update={"raise_stop": 0.0}), raised()
    assert left_to_raise(params, way, way.risen) == 0.0


def test_a_corner_is_pressed_along_the_closing_axis_only_once_the_peg_is_raised() -> None:
    params, way = load().cell.corner.insert, raised()
    np.testing.assert_allclose(lead_at(params, way, way.risen), way.lead, atol=1e-15)
    pressed = lead_at(params, way, way.settled) - way.lead
    np.testing.assert_allclose(pressed, (params.press - params.lead[0]) * way.along, atol=1e-12)
    np.testing.assert_allclose(lead_at(params, way, way.settled + 1.0), way.lead + pressed, atol=1e-15)
    assert abs(way.along @ UP) < 1e-12
    assert way.along @ way.lead > 0.0


def test_a_tip_that_seems_away_until_the_skin_has_told_a_turn_has_not_strayed() -> None:
    params = load().cell.corner.adjust
    away = 1.1 * params.strayed
    watch = Watch().after(1.0, 0.0, 0.0, params).after(1.1, 0.0, away, params)
    assert not watch.has_strayed(1.1)
    assert watch.after(1.1 + STRAYED_FOR, 0.0, away, params).has_strayed(1.01 + STRAYED_FOR)
    assert not watch.after(1.2, 0.0, 0.0, params).has_strayed(1.2 + 0.9 * STRAYED_FOR)


def test_a_peg_that_the_walls_have_caught_cannot_stray() -> None:
    params = load().cell.corner.adjust
    watch = Watch().after(2.0, 1.01 * params.caught, 2.0 * params.strayed, params)
    assert not watch.has_strayed(2.0)


def test_a_peg_that_the_walls_have_caught_and_that_stands_is_between_them() -> None:
    params = load().cell.corner.adjust
    shallow, caught = (Watch().after(1.0, share * params.caught, 0.0, params) for share in (0.9, 1.3))
    assert not caught.is_caught(1.0 + 0.9 * params.stands_for, params)
    assert caught.is_caught(1.0 + 1.1 * params.stands_for, params)
    assert not shallow.is_caught(1.0 + 1.1 * params.stands_for, params)
    sinking = caught.after(1.5, 1.6 * params.caught, 0.0, params)
    assert not sinking.is_caught(1.0 + 1.1 * params.stands_for, params)


def test_a_search_with_a_corner_has_the_keys_of_its_section_and_otherwise_those_of_a_round_peg() -> None:
    corner = CELL.corner
    stated = CELL.params(SEARCH).model_copy(update={"fast_axis": "y", "tilt_azimuth": 0.0})
    search = corner.searching(stated)
    own = {key: getattr(corner, key) for key in ("tilt", "speed", "pitch", "dip_threshold", "lag", "fall")}
    assert search == stated.model_copy(update={**own, "fast_axis": "x"})
    assert all(getattr(stated, key) != value for key, value in own.items())


@pytest.mark.parametrize(
    ("azimuth", "fast"),
    [
        (0.0, "x"),
        (0.78, "x"),
        (0.79, "y"),
        (1.57, "y"),
        (2.35, "y"),
        (2.36, "x"),
        (3.14, "x"),
        (-0.79, "y"),
        (-3.0, "x"),
    ],
)
def test_a_peg_with_corners_is_swept_along_the_axis_that_is_nearest_to_its_closing_axis(
    azimuth: float, fast: str
) -> None:
    stated = CELL.params(SEARCH).model_copy(update={"tilt_azimuth": azimuth})
    assert CELL.corner.searching(stated).fast_axis == fast
