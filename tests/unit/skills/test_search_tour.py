"""Where a search goes that knows something: first there, then everywhere, and hardly later where it knew wrong."""

import math

import numpy as np
import pytest

from cell.config import load
from skills.paths import TURN_TIME
from skills.search.belief import TRIES, Belief
from skills.search.course import ANYWHERE, make_course
from skills.search.tour import Left, Likely, Tour, tour

CONFIG = load().cell
JOB, PARAMS = CONFIG.job(), CONFIG.handling().search
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
    return Belief(Likely((float(x), float(y)), (deviation, deviation)))


GRID = np.stack(np.meshgrid(*[np.linspace(-0.03, 0.03, 13)] * 2), -1).reshape(-1, 2)
"""Holes all over the area, shape (n, 2), m, from its middle."""


def test_a_hole_where_it_is_likely_is_reached_within_a_fifth_of_a_second():
    rng = np.random.default_rng(4)
    for n, hole in enumerate(GRID[::17]):
        assert times(likely(hole + rng.normal(0.0, 7e-4, 2), 7e-4), hole[None], n)[0] < 0.2


def test_a_wrong_belief_costs_no_more_than_a_tenth_of_the_search():
    plain = np.mean([times(ANYWHERE, GRID, seed) for seed in range(16)])
    misled = np.mean([times(likely(place, 7e-4), GRID, seed) for seed, place in enumerate(GRID[::7])])
    assert misled < 1.1 * plain


@pytest.mark.parametrize("deviation", [5e-4, 2e-3, 1e-2])
@pytest.mark.parametrize("place", [(0.0, 0.0), (0.03, -0.03), (-0.029, 0.01)])
def test_no_place_of_the_area_is_left_out(deviation, place):
    assert times(likely(np.array(place), deviation), GRID, seed=5).max() < 12.0


@pytest.mark.parametrize("deviation", [5e-4, 1e-2, 0.2])
@pytest.mark.parametrize("place", [(0.0, 0.0), (0.03, -0.03), (-0.06, 0.01)])
def test_no_search_comes_down_beside_the_plate(place, deviation):
    """A place that is told as wider than the area: the peg would come down beyond the border that is taken for granted round it."""
    (least_x, least_y), (most_x, most_y) = JOB.hole.plate_bounds
    for seed in range(8):
        course = make_course(PARAMS, JOB, np.random.default_rng(seed), likely(np.array(place), deviation))
        for time in np.arange(0.0, 20.0, 0.02):
            x, y = course.middle + course.path.at(time)[0]
            assert least_x + 0.02 < x < most_x - 0.02
            assert least_y + 0.02 < y < most_y - 0.02


def test_the_way_has_no_jumps_and_keeps_to_a_bounded_speed():
    path = make_course(PARAMS, JOB, np.random.default_rng(6), likely(np.array([0.01, 0.02]), 1e-3)).path
    assert isinstance(path, Tour)
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
        assert belief.likely is not None
        assert belief.likely.mean == (0.51, 0.01)
    belief = belief.after((0.511, 0.01), WIDTH, Left(path, 2.0))
    assert belief.likely is None
    onwards = make_course(PARAMS, JOB, np.random.default_rng(8), belief).path
    assert onwards.at(0.0)[0] == pytest.approx(path.at(2.0 + 1.5 * WIDTH / PARAMS.speed)[0])


def test_what_an_attempt_has_swept_comes_last_in_the_next():
    path = make_course(PARAMS, JOB, np.random.default_rng(9)).path
    belief = ANYWHERE.after((0.5, 0.0), WIDTH, Left(path, 3.0))
    onwards = make_course(PARAMS, JOB, np.random.default_rng(10), belief).path
    assert isinstance(onwards, Tour)
    assert onwards.duration < 1.6
    assert onwards.at(onwards.duration + 0.5)[0] == pytest.approx(path.at(3.5)[0])


def test_strokes_far_apart_are_joined_by_a_stop_and_a_start():
    path = tour([((0.0, 0.0), (0.01, 0.0)), ((0.0, 0.05), (0.01, 0.05))], 0.1, Left(tour_end(), 0.0))
    assert path.at(0.1 + TURN_TIME / 2)[1] == pytest.approx(np.zeros(2), abs=1e-9)
    assert math.hypot(*path.at(path.duration)[0]) == pytest.approx(0.0, abs=1e-9)


def tour_end() -> Tour:
    """Return a way that stays at the middle."""
    return tour([((0.0, 0.0), (0.0, 0.0))], 0.1, Left(make_course(PARAMS, JOB, np.random.default_rng(1)).path, 0.0))
