"""Where a search goes that knows something: first there, then everywhere, and hardly later where it knew wrong."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from drivers.parts import HolePrior
from skills.paths import TURN_TIME
from skills.search.belief import TRIES, Belief
from skills.search.course import ANYWHERE, make_course
from skills.search.tour import Left, Leg, Rows, Tour, beside, first_look, outwards, tour

CONFIG = load().cell
JOB, PARAMS = CONFIG.job(), CONFIG.plan().search
WIDTH = JOB.hole.part.inscribed
CAUGHT = 0.51 * PARAMS.pitch * WIDTH
"""A hole so far from a lane is found by it, m: half the pitch, and what rounding takes."""
CENTRE = np.array(JOB.hole.centre[:2])


def times(belief: Belief, holes: np.ndarray, seed: int) -> np.ndarray:
    """Return when the path of a search comes by each hole, shape (n, 2), m, from the middle of the area, s."""
    path = make_course(PARAMS, JOB, np.random.default_rng(seed), belief).path
    stamps = np.arange(0.0, 15.0, 0.02)
    offsets = np.abs(np.array([path.at(time)[0] for time in stamps])[:, None] - holes)
    by = (offsets[..., 0] <= CAUGHT) & (offsets[..., 1] <= 2e-3)
    assert by.any(axis=0).all()
    return stamps[by.argmax(axis=0)]


def likely(place: np.ndarray, deviation: float) -> Belief:
    """Return the belief that the hole is about a place, given from the middle of the area."""
    x, y = CENTRE + place
    return Belief(HolePrior(mean=(float(x), float(y)), deviation=(deviation, deviation)))


GRID = np.stack(np.meshgrid(*[np.linspace(-0.03, 0.03, 13)] * 2), -1).reshape(-1, 2)
"""Holes all over the area, shape (n, 2), m, from its middle."""


def test_a_hole_where_it_is_likely_is_reached_within_a_third_of_a_second():
    rng = np.random.default_rng(4)
    for n, hole in enumerate(GRID[::17]):
        assert times(likely(hole + rng.normal(0.0, 7e-4, 2), 7e-4), hole[None], n)[0] < 1.0 / 3.0


def test_a_wrong_belief_costs_no_more_than_a_tenth_of_the_search():
    plain = np.mean([times(ANYWHERE, GRID, seed) for seed in range(16)])
    misled = np.mean([times(likely(place, 7e-4), GRID, seed) for seed, place in enumerate(GRID[::7])])
    assert misled < 1.1 * plain


@pytest.mark.parametrize("deviation", [5e-4, 2e-3, 1e-2])
@pytest.mark.parametrize("place", [(0.0, 0.0), (0.03, -0.03), (-0.029, 0.01)])
def test_no_place_of_the_area_is_left_out(deviation, place):
    assert times(likely(np.array(place), deviation), GRID, seed=5).max() < 12.0


@pytest.mark.parametrize("deviation", [5e-4, 1e-2, 0.1])
@pytest.mark.parametrize("place", [(0.0, 0.0), (0.03, -0.03), (-0.06, 0.01)])
def test_no_search_comes_down_beside_the_plate(place, deviation):
    """A prior wider than the area: the peg would come down beyond the assumed border."""
    (least_x, least_y), (most_x, most_y) = JOB.hole.plate_bounds
    for seed in range(8):
        course = make_course(PARAMS, JOB, np.random.default_rng(seed), likely(np.array(place), deviation))
        for time in np.arange(0.0, 20.0, 0.02):
            x, y = course.middle + course.path.at(time)[0]
            assert least_x + 0.02 < x < most_x - 0.02
            assert least_y + 0.02 < y < most_y - 0.02


def test_the_way_has_no_jumps_and_keeps_to_a_bounded_speed():
    path = make_course(PARAMS, JOB, np.random.default_rng(6), likely(np.array([0.01, 0.02]), 1e-3)).path
    period = 1e-3
    points = [path.at(time) for time in np.arange(0.0, path.duration + 1.0, period)]
    steps = np.linalg.norm(np.diff([point for point, _ in points], axis=0), axis=1)
    told = np.linalg.norm([velocity for _, velocity in points], axis=1)
    assert steps.max() < 1.5 * 1.05 * PARAMS.speed * period
    assert steps == pytest.approx((told[1:] + told[:-1]) / 2 * period, abs=0.05 * PARAMS.speed * period)


def test_a_place_that_failed_is_tried_again_and_then_left_for_the_rest_of_the_area():
    path = make_course(PARAMS, JOB, np.random.default_rng(7)).path
    belief = ANYWHERE
    for _ in range(TRIES - 1):
        belief = belief.after((0.51, 0.01), WIDTH, Left(path, 2.0))
        assert belief.likely.mean == (0.51, 0.01)
    belief = belief.after((0.511, 0.01), WIDTH, Left(path, 2.0))
    assert belief.likely is None
    onwards = make_course(PARAMS, JOB, np.random.default_rng(8), belief).path
    assert onwards.at(0.0)[0] == pytest.approx(path.at(2.0 + 1.5 * WIDTH / PARAMS.speed)[0])


def tour_end() -> Tour:
    """Return a way that stays at the middle."""
    return tour([((0.0, 0.0), (0.0, 0.0))], 0.1, Left(make_course(PARAMS, JOB, np.random.default_rng(1)).path, 0.0))


ROWS = Rows(half=(0.03, 0.02), fast=1, pitch=0.01, speed=0.1)
"""Six strokes along y, 10 mm apart."""
HERE = (0.5, 0.1)
"""Middle of their area, m, base frame."""


def about(across: float, along: float = 0.0, deviation: float = 1e-3) -> HolePrior:
    """Return the belief that the hole is about a place, given across and along the strokes from the middle, m."""
    return HolePrior(mean=(HERE[0] + across, HERE[1] + along), deviation=(deviation, deviation))


@pytest.mark.parametrize(
    ("across", "near", "order"),
    [
        (0.006, 0, (5, 15, 25, -5, -15, -25)),
        (0.006, 1, (5, 15, -5, 25, -15, -25)),
        (-0.006, 1, (-5, 5, -15, -25, 15, 25)),
        (-0.006, 0, (-5, -15, -25, 5, 15, 25)),
        (-0.006, 2, (-5, 5, -15, 15, -25, 25)),
        (0.024, 2, (25, 15, 5, -5, -15, -25)),
        (0.03, 0, (25, 15, 5, -5, -15, -25)),
        (-0.03, 0, (-25, -15, -5, 5, 15, 25)),
        (1.0, 0, (25, 15, 5, -5, -15, -25)),
    ],
)
def test_strokes_go_from_the_likely_one_to_its_neighbours_to_the_nearer_border_and_to_the_other(across, near, order):
    assert ROWS.order(across, near) == pytest.approx([place * 1e-3 for place in order])


def test_strokes_lie_a_pitch_apart_at_most_and_half_as_far_from_the_borders():
    assert replace(ROWS, fast=0, pitch=0.0131).order(0.0, 0) == pytest.approx([0.005, 0.015, -0.005, -0.015])
    assert replace(ROWS, half=(0.03, 0.001), fast=0, pitch=0.0131).order(0.0, 0) == [0.0]


@pytest.mark.parametrize(("deviation", "others"), [(1e-4, 0), (1.66e-3, 0), (1.67e-3, 1), (4.99e-3, 1), (5.01e-3, 2)])
def test_as_many_strokes_lie_on_either_side_as_three_deviations_ask_for(deviation, others):
    assert beside(HolePrior(mean=(0.0, 0.0), deviation=(deviation, 0.09)), ROWS) == others


@pytest.mark.parametrize(("way", "begin"), [(1.0, 0.005 - 0.028), (-1.0, 0.020 + 0.007)])
def test_the_first_look_goes_there_and_back_over_three_deviations_from_outside_of_the_hole(way, begin):
    """Along y 6 mm about the place on either side, and half a hole; 15 mm more before it, no further than 7 mm outside the area."""
    strokes = first_look(about(0.004, 0.005, 2e-3), HERE, ROWS, width=8e-3, outside=7e-3, way=way)
    end, near, far = 0.005 + way * 0.010, 0.005 + way * 0.010, 0.005 - way * 0.010
    expected = [
        ((0.004, begin), (0.004, end)),
        ((0.014, near), (0.014, far)),
        ((-0.006, far), (-0.006, near)),
    ]
    assert np.array(strokes) == pytest.approx(np.array(expected))


def test_the_first_look_ends_at_the_border_and_begins_no_further_outside_than_the_peg_has_to():
    strokes = first_look(about(0.028, 0.019, 2e-3), HERE, ROWS, width=8e-3, outside=7e-3, way=1.0)
    expected = [((0.028, -0.009), (0.028, 0.02)), ((0.018, 0.024), (0.018, 0.009))]
    assert np.array(strokes) == pytest.approx(np.array(expected))
    beyond = first_look(about(0.09, -0.09, 1e-4), HERE, ROWS, width=8e-3, outside=7e-3, way=1.0)
    assert np.array(beyond) == pytest.approx(np.array([((0.03, -0.027), (0.03, -0.0157))]))
    wide = first_look(about(0.0, 0.0, 0.011), HERE, ROWS, width=8e-3, outside=7e-3, way=1.0)
    assert wide[0] == ((0.0, pytest.approx(-0.027)), (0.0, pytest.approx(0.02)))
    assert wide[1] == ((0.01, pytest.approx(0.024)), (0.01, pytest.approx(-0.02)))


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_strokes_over_the_area_turn_at_its_borders_and_what_lies_before_the_first_comes_last(way):
    strokes = outwards(about(0.006), HERE, ROWS, start=way * -0.012, way=way)
    assert [begin[0] for begin, _ in strokes] == pytest.approx([0.005, 0.015, 0.025, -0.005, -0.015, -0.025, 0.005])
    along = [(way * begin[1], way * end[1]) for begin, end in strokes]
    there, back = (-0.02, 0.02), (0.02, -0.02)
    expected = [(-0.012, 0.02), back, there, back, there, back, (-0.02, -0.012)]
    assert np.array(along) == pytest.approx(np.array(expected))


@pytest.mark.parametrize(
    ("start", "first", "last"),
    [
        (-0.02, ((0.005, -0.02), (0.005, 0.02)), ((-0.025, 0.02), (-0.025, -0.02))),
        (-0.025, ((0.005, -0.025), (0.005, 0.02)), ((-0.025, 0.02), (-0.025, -0.02))),
        (0.03, ((0.015, 0.02), (0.015, -0.02)), ((0.005, -0.02), (0.005, 0.02))),
    ],
    ids=["border", "outside", "beyond the far border"],
)
def test_a_first_stroke_from_outside_has_nothing_before_it_or_is_left_out(start, first, last):
    strokes = outwards(about(0.006), HERE, ROWS, start=start, way=1.0)
    assert len(strokes) == 6
    assert np.array([strokes[0], strokes[-1]]) == pytest.approx(np.array([first, last]))


def test_a_leg_goes_from_point_to_point_with_the_velocities_that_it_is_given():
    leg = Leg(1.0, 0.5, ((0.0, 0.0), (0.1, -0.2)), ((0.3, 0.1), (-0.2, 0.4)))
    assert leg.at(1.0) == (pytest.approx((0.0, 0.0)), pytest.approx((0.3, 0.1)))
    assert leg.at(1.5) == (pytest.approx((0.1, -0.2)), pytest.approx((-0.2, 0.4)))
    for time in (1.1, 1.25, 1.4):
        rate = (leg.at(time + 1e-6)[0] - leg.at(time - 1e-6)[0]) / 2e-6
        assert leg.at(time)[1] == pytest.approx(rate, abs=1e-6)


def test_strokes_take_the_time_of_their_length_and_are_joined_by_one_turn_where_they_are_near():
    """The turn is 12 mm wide: a time and a half of what it takes at full speed. Where the path behind goes on, no turn is left."""
    onward = tour([((0.01, 0.0), (0.01, 0.05))], 0.1, Left(tour_end(), 0.0))
    way = tour([((0.0, 0.0), (0.0, 0.03)), ((0.012, 0.03), (0.012, 0.0))], 0.1, Left(tour_end(), 0.0))
    assert [leg.duration for leg in way.legs[:3]] == pytest.approx([0.3, 0.18, 0.3])
    assert [leg.began for leg in way.legs[:3]] == pytest.approx([0.0, 0.3, 0.48])
    assert way.legs[1].velocities == (pytest.approx((0.0, 0.1)), pytest.approx((0.0, -0.1)))
    close = tour([((0.0, 0.0), (0.0, 0.03)), ((1e-3, 0.03), (1e-3, 0.0))], 0.1, Left(tour_end(), 0.0))
    assert close.legs[1].duration == pytest.approx(TURN_TIME)
    through = tour([((0.01, -0.02), (0.01, 0.0)), ((0.01, 0.0), (0.01, 0.05))], 0.1, Left(onward, 0.0))
    assert [leg.duration for leg in through.legs[:2]] == pytest.approx([0.2, 0.5])


def test_far_apart_there_is_a_stop_a_straight_line_and_a_start():
    way = tour([((0.0, 0.0), (0.0, 0.03)), ((0.08, 0.0), (0.08, 0.03))], 0.1, Left(tour_end(), 0.0))
    stop, line, start = way.legs[1:4]
    assert (stop.duration, start.duration) == pytest.approx((TURN_TIME / 2, TURN_TIME / 2))
    assert stop.points == (pytest.approx((0.0, 0.03)), pytest.approx((0.0, 0.0325)))
    assert line.points == (pytest.approx((0.0, 0.0325)), pytest.approx((0.08, -0.0025)))
    assert start.points == (pytest.approx((0.08, -0.0025)), pytest.approx((0.08, 0.0)))
    assert line.duration == pytest.approx(1.5 * math.hypot(0.08, 0.035) / 0.1)
    assert line.velocities == ((0.0, 0.0), (0.0, 0.0))
    assert [leg.began for leg in way.legs[1:5]] == pytest.approx([0.3, 0.35, 0.35 + line.duration, 0.4 + line.duration])


def test_behind_the_strokes_the_rest_of_the_other_path_follows_without_a_jump():
    rest = Left(make_course(PARAMS, JOB, np.random.default_rng(7)).path, 1.3)
    way = tour([((0.0, 0.0), (0.0, 0.03))], 0.1, rest)
    place, rate = rest.path.at(1.3)
    before, after = way.at(way.duration - 1e-9), way.at(way.duration)
    assert (before[0], before[1]) == (pytest.approx(place, abs=1e-7), pytest.approx(rate, abs=1e-6))
    assert (after[0], after[1]) == (pytest.approx(place), pytest.approx(rate))
    assert way.at(way.duration + 0.4)[0] == pytest.approx(rest.path.at(1.7)[0])
    assert tour([], 0.1, rest).duration == 0.0


def test_the_area_is_covered_once_the_strokes_and_the_rest_of_the_path_are_over():
    whole = make_course(PARAMS, JOB, np.random.default_rng(7)).path
    strokes = [((0.0, 0.0), (0.0, 0.03))]
    for since, rest in ((1.3, whole.cover - 1.3), (whole.cover, 0.0), (whole.cover + 5.0, 0.0)):
        way = tour(strokes, 0.1, Left(whole, since))
        assert way.cover == pytest.approx(way.duration + rest)
