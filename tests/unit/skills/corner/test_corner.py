"""A square peg's corner, and the turns that find how its hole is turned."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP, angle_between, rotation_about
from drivers.part.rectangular import Rectangular
from skills.catalogue import SEARCH
from skills.corner.insert import left_to_raise, raise_from, sweep_of, to_and_fro, turned_by

SIDE = 0.008
CELL = load().cell
SQUARE = Rectangular(SIDE, SIDE)


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


def test_each_attempt_sweeps_about_its_own_middle_and_at_least_as_far_as_a_wall_is_felt() -> None:
    cell, most = load(sets=("peg.shape=square",)).cell, math.radians(10.0)
    sweeps = [sweep_of(cell.plan(attempt).corner.insert, most) for attempt in range(4)]
    assert [sweep.centre for sweep in sweeps] == pytest.approx([0.0, 0.6 * most, -0.6 * most, 0.0])
    params = cell.corner.insert
    assert sweep_of(params, 0.0).reach == pytest.approx(params.felt + params.margin)


def test_the_first_sweep_covers_every_yaw_that_the_hole_can_have_within_its_timeout_and_no_sweep_goes_beyond() -> None:
    cell, most = load(sets=("peg.shape=square",)).cell, math.radians(10.0)
    for attempt in range(3):
        params = cell.plan(attempt).corner.insert
        sweep = sweep_of(params, most)
        yaws = [sweep.yaw(time, 1.5, params) for time in np.arange(1.5, params.timeout, 0.01)]
        assert max(np.abs(yaws)) <= most + params.margin
        assert attempt > 0 or (min(yaws) < -most and max(yaws) > most)


@pytest.mark.parametrize("stop", [0.0, 0.3])
@pytest.mark.parametrize("tilt", [0.05, 0.5])
def test_a_peg_begins_where_it_leans_and_goes_to_its_tilt_from_either_side(tilt: float, stop: float) -> None:
    params = CELL.corner.insert.model_copy(update={"raise_stop": stop})
    axis, closing = SQUARE.leaning(0.0, tilt)
    hand = np.column_stack([-axis, np.cross(closing, -axis), closing])
    seen = SimpleNamespace(axis=axis, arm=SimpleNamespace(tcp=SimpleNamespace(rotation=hand)))
    way = raise_from(seen, UP, params)
    lefts = [left_to_raise(params, way, time) for time in np.linspace(0.0, way.risen, 20)]
    leans = [angle_between(UP, rotation_about(way.about, left) @ way.axis) for left in lefts]
    assert (leans[0], leans[-1]) == pytest.approx((tilt, params.tilt))
    assert np.all(np.diff(leans) * (params.tilt - tilt) >= -1e-12)


def test_a_search_with_a_corner_has_the_keys_of_its_section_and_otherwise_those_of_a_round_peg() -> None:
    corner = CELL.corner
    stated = CELL.params(SEARCH).model_copy(update={"fast_axis": "y", "tilt_azimuth": 0.0})
    search = corner.searching(stated)
    own = {key: getattr(corner, key) for key in ("tilt", "speed", "pitch", "dip_threshold", "lag", "fall")}
    assert search == stated.model_copy(update={**own, "fast_axis": "x"})
    assert all(getattr(stated, key) != value for key, value in own.items())


@pytest.mark.parametrize(
    ("azimuth", "fast"), [(0.0, "x"), (0.78, "x"), (0.79, "y"), (2.35, "y"), (2.36, "x"), (-0.79, "y"), (-3.0, "x")]
)
def test_a_peg_with_corners_is_swept_along_the_axis_that_is_nearest_to_its_closing_axis(
    azimuth: float, fast: str
) -> None:
    stated = CELL.params(SEARCH).model_copy(update={"tilt_azimuth": azimuth})
    assert CELL.corner.searching(stated).fast_axis == fast
