"""Where a course leads the peg over the area: likely places first, and round decoys."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from drivers.parts import HolePrior
from skills.catalogue import SEARCH
from skills.paths import TURN_TIME
from skills.search.belief import Belief
from skills.search.course import ANYWHERE, leading, make_course
from skills.search.decoys import BLIND, SHALLOW, THROUGH, Decoy, decoy_at
from skills.search.tour import GATE, Left
from skills.seating.decision import CLOSED_TOLERANCE

RIM = np.linspace(-math.pi, math.pi, 2001)
"""Angles about the axis of the peg's end, from its lowest point, rad."""
ALONG = np.linspace(-3e-3, 3e-3, 61)
"""Places along a lane, from the hole's middle, m."""


def falls(edge: float, tilt: float, depth: float, peg: float = 4e-3, hole: float = 4.05e-3) -> bool:
    """Return whether a round peg that leans towards x fits into a hole somewhere along a lane with its lowest point `edge` from the
    hole's middle, across the lane, and `depth` below the surface, m.
    """
    up = peg * (1.0 - np.cos(RIM)) * math.sin(tilt) - depth
    x, y = edge - peg * (1.0 - np.cos(RIM)) * math.cos(tilt), peg * np.sin(RIM)
    below = up < 0.0
    outline = np.array([np.concatenate([x[below], (x - up * math.tan(tilt))[below]]), np.tile(y[below], 2)])
    return any((np.hypot(outline[0], outline[1] - place) <= hole).all() for place in ALONG)


@pytest.mark.parametrize("tilt", [0.5, 0.785, 1.0])
@pytest.mark.parametrize("fall", [0.3e-3, 0.6e-3])
def test_the_band_in_which_a_peg_falls_lies_evenly_about_its_lanes(tilt, fall):
    """The band is that of the exact shapes: end and side of the peg below the surface within the hole's rim."""
    off = 4e-3 * math.cos(tilt) - leading(4e-3, tilt, fall)
    places = [place for place in np.arange(-5e-3, 5e-3, 0.05e-3) if falls(place, tilt, fall)]
    assert (min(places) + max(places)) / 2 == pytest.approx(off, abs=0.1e-3)


CELL = load().cell
PARAMS = CELL.params(SEARCH)
AREA = (0.06, 0.04)
WIDTH = CELL.hole.part.inscribed
SEEDS = range(16)


def course_of(seed=0, belief=ANYWHERE, is_length_known=True, chamfer=0.0, **keys):
    """Return a course over an oblong area, with these parameters beside the shipped ones."""
    hole = CELL.hole.model_copy(update={"area": AREA, "chamfer": chamfer})
    job = CELL.job().model_copy(update={"hole": hole})
    params = PARAMS.model_copy(update=keys)
    return make_course(params, job, np.random.default_rng(seed), belief, is_length_known)


def points(course, end, start=0.0):
    """Return the points of its path from the middle of the area, shape (n, 2), m."""
    return np.array([course.path.at(time)[0] for time in np.arange(start, end, 0.005)])


def likely(across=0.0, deviation=5e-4, fast=1):
    """Return the belief that the hole is about a place beside the middle of the area, across the lanes."""
    place = np.array(CELL.hole.centre[:2])
    place[1 - fast] += across
    return Belief(HolePrior(mean=(float(place[0]), float(place[1])), deviation=(deviation, deviation)))


@pytest.mark.parametrize("chamfer", [0.0, 1e-3])
@pytest.mark.parametrize(("axis", "fast"), [("x", 0), ("y", 1)])
def test_lanes_begin_beside_the_area_outside_of_any_hole(axis, fast, chamfer):
    begun = [course_of(seed, fast_axis=axis, chamfer=chamfer) for seed in SEEDS]
    starts = np.array([each.path.at(0.0)[0] for each in begun])
    beyond = np.abs(starts[:, fast]) - AREA[fast] / 2 - WIDTH / 2 - chamfer
    assert (beyond.min(), beyond.max()) == pytest.approx((PARAMS.outside[0], PARAMS.outside[1]), abs=0.5e-3)
    assert PARAMS.outside[0] <= beyond.min() <= beyond.max() <= PARAMS.outside[1]
    assert {(x > 0.0, y > 0.0) for x, y in starts} == {(a, b) for a in (True, False) for b in (True, False)}
    for each, start in zip(begun, starts, strict=True):
        assert each.fast == fast
        assert each.path.at(0.0)[1][fast] * start[fast] < 0.0


@pytest.mark.parametrize(("axis", "fast"), [("x", 0), ("y", 1)])
def test_lanes_reach_beyond_the_area_and_lie_a_pitch_apart(axis, fast):
    course = course_of(fast_axis=axis, margin=2e-3, pitch=0.6)
    swept = np.abs(points(course, course.path.cover - TURN_TIME, start=0.6))
    half = AREA[1 - fast] / 2 + 2e-3
    lanes = math.ceil(2 * half / (0.6 * WIDTH))
    assert swept[:, fast].max() == pytest.approx(AREA[fast] / 2 + 2e-3, abs=2e-4)
    assert course.path.lanes == lanes
    assert swept[:, 1 - fast].max() == pytest.approx(half * (1.0 - 1.0 / lanes), abs=2e-4)


@pytest.mark.parametrize("azimuth", [0.0, 2.0])
def test_the_peg_leans_with_its_edge_on_the_path(azimuth):
    course = course_of(tilt_azimuth=azimuth)
    lean = np.array([math.cos(azimuth), math.sin(azimuth)])
    np.testing.assert_allclose(course.axis, [*(math.sin(PARAMS.tilt) * lean), math.cos(PARAMS.tilt)])
    np.testing.assert_allclose(course.closing, [*(math.cos(PARAMS.tilt) * lean), -math.sin(PARAMS.tilt)])
    ahead = leading(CELL.peg.part.reach, PARAMS.tilt, PARAMS.fall) * lean
    np.testing.assert_allclose(course.middle + ahead, CELL.hole.centre[:2])
    np.testing.assert_allclose(course.first[:2], course.middle + course.path.at(0.0)[0])


@pytest.mark.parametrize(("is_known", "further"), [(True, 0.0), (False, PARAMS.length_bound * math.cos(PARAMS.tilt))])
@pytest.mark.parametrize("diameter", [0.004, 0.008, 0.03])
def test_all_of_a_leaning_peg_is_free_where_the_course_begins(diameter, is_known, further):
    peg, hole = (each.model_copy(update={"diameter": diameter}) for each in (CELL.peg, CELL.hole))
    job = CELL.job().model_copy(update={"peg": peg, "hole": hole})
    course = make_course(PARAMS, job, np.random.default_rng(0), ANYWHERE, is_known)
    lowest = peg.part.lowest(course.first, course.axis, course.closing)
    assert lowest[2] - hole.centre[2] >= PARAMS.free_gap + further - 1e-9
    assert course.height == pytest.approx(course.first[2] - hole.centre[2])


@pytest.mark.parametrize("belief", [ANYWHERE, likely(deviation=8e-3)], ids=["unknown", "known badly"])
def test_a_badly_known_place_has_no_stroke_of_its_own(belief):
    assert course_of(belief=belief).likely_until == 0.0


@pytest.mark.parametrize("across", [0.0, 8e-3])
def test_one_stroke_over_a_well_known_place_begins_a_lane(across):
    course = course_of(belief=likely(across))
    begin = course.path.at(0.0)[0]
    # It ends half a hole beyond three deviations behind the most likely place.
    length = abs(begin[1]) + GATE * 5e-4 + WIDTH / 2
    assert course.likely_until == pytest.approx(length / PARAMS.speed)
    np.testing.assert_allclose(points(course, course.likely_until)[:, 0], across, atol=1e-9)
    after = -np.sign(begin[1]) * points(course, course.likely_until + 0.25, course.likely_until)[:, 1]
    assert after.min() > 0.0
    assert after.max() > GATE * 5e-4 + WIDTH


def test_the_lane_over_a_less_known_place_is_swept_again():
    course = course_of(belief=likely(deviation=3.5e-3))
    begin = course.path.at(0.0)[0]
    assert course.likely_until == pytest.approx((abs(begin[1]) + GATE * 3.5e-3 + WIDTH / 2) / PARAMS.speed)
    after = points(course, course.likely_until + 1.2, course.likely_until)
    assert np.abs(after[:, 1] - begin[1]).min() < 1e-3


def test_a_next_attempt_looks_again_and_goes_on_with_the_rest():
    left = Left(course_of(seed=3).path, 1.5)
    deviation = 0.4 * PARAMS.pitch * WIDTH  # one lane on each side
    belief = replace(likely(deviation=deviation), left=left)
    course = course_of(belief=belief)
    assert course.path.then == left
    begin = abs(course.path.at(0.0)[0][1])
    first, others = begin + GATE * deviation + WIDTH / 2, 2 * GATE * deviation + WIDTH
    assert course.likely_until == pytest.approx((first + 2 * others) / PARAMS.speed)


def test_one_stroke_suffices_if_the_place_is_known_across_the_lanes():
    x, y = CELL.hole.centre[:2]
    course = course_of(belief=Belief(HolePrior(mean=(x, y), deviation=(5e-4, 3.5e-3))))
    begin = course.path.at(0.0)[0]
    after = -np.sign(begin[1]) * points(course, course.likely_until + 0.2, course.likely_until)[:, 1]
    assert after.max() > 0.019  # it goes on to the border, and not back to where it began


JOB, IN_FORCE = CELL.job(), CELL.plan().search
HOLE = JOB.hole
PLACE = (0.51, 0.01)


@pytest.mark.parametrize(
    ("depth", "radius"),
    [
        (0.99 * SHALLOW * HOLE.depth, BLIND * WIDTH),
        (1.01 * SHALLOW * HOLE.depth, None),
        (HOLE.depth + 0.99 * CLOSED_TOLERANCE, None),
        (HOLE.depth + 1.01 * CLOSED_TOLERANCE, THROUGH * WIDTH),
    ],
)
def test_a_peg_far_from_the_bottom_is_in_a_decoy(depth, radius):
    assert decoy_at(PLACE, PLACE, depth, HOLE) == (None if radius is None else Decoy(PLACE, radius))


@pytest.mark.parametrize(("depth", "radius"), [(0.0, BLIND * WIDTH), (2.0 * HOLE.depth, THROUGH * WIDTH)])
@pytest.mark.parametrize(("strayed", "is_held"), [(0.99, True), (1.01, False)])
def test_a_peg_that_has_strayed_is_in_no_decoy(strayed, is_held, depth, radius):
    decoy = decoy_at((PLACE[0] + strayed * radius, PLACE[1]), PLACE, depth, HOLE)
    assert (decoy is not None) is is_held


def course_past(seed, path=None, since=0.0):
    """Return the course after a decoy at `PLACE`."""
    left = None if path is None else Left(path, since)
    return make_course(IN_FORCE, JOB, np.random.default_rng(seed), Belief().past(Decoy(PLACE, WIDTH), left))


def away(course, time):
    """Return the distance of the peg's lowest point from the decoy at a time along the path, m."""
    return math.dist(course.path.at(time)[0] + course.lowest, PLACE)


@pytest.mark.parametrize("seed", range(4))
def test_every_lane_that_meets_a_decoy_goes_on_behind_it(seed):
    course = course_past(seed)
    inside = [time for time in np.arange(0.0, course.until, 0.02) if away(course, time) < WIDTH]
    assert inside
    for time in inside:
        behind = course.beyond(time)
        assert WIDTH <= away(course, behind) < 1.3 * WIDTH or behind >= course.until


def test_a_search_that_goes_on_comes_down_behind_the_decoy():
    first = course_past(5)
    since = next(time for time in np.arange(0.0, 10.0, 0.02) if away(first, time) < WIDTH)
    course = course_past(6, first.path, float(since))
    assert course.since > 0.0
    assert away(course, course.since) >= WIDTH
    assert course.first[:2] == pytest.approx(course.middle + course.path.at(course.since)[0])


@pytest.mark.parametrize(("share", "until"), [(0.0, 1.0), (0.9, 0.1), (1.0, 1.0)])
def test_a_decoy_is_tried_again_once_the_rest_is_covered(share, until):
    """A decoy of the second cover is passed over for a cover."""
    whole = course_past(7).path
    course = course_past(7, whole, share * whole.cover)
    assert course.until == pytest.approx(until * whole.cover)
    later = next(time for time in np.arange(course.until, 30.0, 0.02) if away(course, time) < WIDTH)
    assert course.beyond(float(later)) == later
