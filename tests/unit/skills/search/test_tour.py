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
from skills.search.tour import Left, Rows, Tour, beside, first_look, outwards, tour

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
    offsets = np.array([path.at(time)[0] for time in stamps])[:, None] - holes
    by = np.hypot(offsets[..., 0], offsets[..., 1]) <= CAUGHT
    assert by.any(axis=0).all()
    return stamps[by.argmax(axis=0)]


def likely(place: np.ndarray, deviation: float) -> Belief:
    """Return the belief that the hole is about a place, given from the middle of the area."""
    x, y = CENTRE + place
    return Belief(HolePrior(mean=(float(x), float(y)), deviation=(deviation, deviation)))


GRID = np.stack(np.meshgrid(*[np.linspace(-0.03, 0.03, 13)] * 2), -1).reshape(-1, 2)
"""Holes all over the area, shape (n, 2), m, from its middle."""


def test_a_likely_hole_is_reached_within_a_third_of_a_second():
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


def test_a_place_that_failed_is_tried_again_and_then_left():
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
def test_strokes_go_from_the_likely_one_outwards_the_nearer_border_first(across, near, order):
    assert ROWS.order(across, near) == pytest.approx([place * 1e-3 for place in order])


def test_strokes_lie_at_most_a_pitch_apart():
    assert replace(ROWS, fast=0, pitch=0.0131).order(0.0, 0) == pytest.approx([0.005, 0.015, -0.005, -0.015])
    assert replace(ROWS, half=(0.03, 0.001), fast=0, pitch=0.0131).order(0.0, 0) == [0.0]


@pytest.mark.parametrize(("deviation", "others"), [(1e-4, 0), (1.66e-3, 0), (1.67e-3, 1), (4.99e-3, 1), (5.01e-3, 2)])
def test_strokes_on_either_side_cover_three_deviations(deviation, others):
    assert beside(HolePrior(mean=(0.0, 0.0), deviation=(deviation, 0.09)), ROWS) == others


THERE, FAR = 0.015, -0.005
"""Ends of the strokes over a place 5 mm along: three deviations of 2 mm on either side, and half of a hole, m."""


@pytest.mark.parametrize(
    ("likely", "way", "strokes"),
    [
        (about(0.004, 0.005, 2e-3), 1.0, [(0.004, -0.023, THERE), (0.014, THERE, FAR), (-0.006, FAR, THERE)]),
        (about(0.004, 0.005, 2e-3), -1.0, [(0.004, 0.027, FAR), (0.014, FAR, THERE), (-0.006, THERE, FAR)]),
        (about(0.028, 0.019, 2e-3), 1.0, [(0.028, -0.009, 0.02), (0.018, 0.024, 0.009)]),
        (about(0.09, -0.09, 1e-4), 1.0, [(0.03, -0.027, -0.0157)]),
        (
            HolePrior(mean=HERE, deviation=(2e-3, 0.011)),
            1.0,
            [(0.0, -0.027, 0.02), (0.01, 0.024, -0.02), (-0.01, -0.024, 0.02)],
        ),
    ],
    ids=["there and back", "from the other side", "at the border", "beyond the border", "wide"],
)
def test_the_first_look_covers_three_deviations_from_outside_of_the_hole_on(likely, way, strokes):
    """The first stroke is 15 mm longer before the place, but begins no further than 7 mm outside the area."""
    found = first_look(likely, HERE, ROWS, width=8e-3, outside=7e-3, way=way)
    expected = [((across, begin), (across, end)) for across, begin, end in strokes]
    assert np.array(found) == pytest.approx(np.array(expected))


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_strokes_turn_at_the_borders_and_end_before_the_first(way):
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
def test_a_first_stroke_from_outside_is_whole_or_left_out(start, first, last):
    strokes = outwards(about(0.006), HERE, ROWS, start=start, way=1.0)
    assert len(strokes) == 6
    assert np.array([strokes[0], strokes[-1]]) == pytest.approx(np.array([first, last]))


def test_near_strokes_are_joined_by_one_turn():
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
    line = 1.5 * math.hypot(0.08, 0.035) / 0.1
    assert [leg.duration for leg in way.legs[:5]] == pytest.approx([0.3, TURN_TIME / 2, line, TURN_TIME / 2, 0.3])
    assert way.legs[2].points == (pytest.approx((0.0, 0.0325)), pytest.approx((0.08, -0.0025)))


def test_the_area_is_covered_after_the_strokes_and_the_rest():
    whole = make_course(PARAMS, JOB, np.random.default_rng(7)).path
    strokes = [((0.0, 0.0), (0.0, 0.03))]
    for since, rest in ((1.3, whole.cover - 1.3), (whole.cover, 0.0), (whole.cover + 5.0, 0.0)):
        way = tour(strokes, 0.1, Left(whole, since))
        assert way.cover == pytest.approx(way.duration + rest)
