"""Decoys are recognised by the depth of the peg, and the search passes over them for one cover of the area."""

import math

import numpy as np
import pytest

from cell.config.load import load
from skills.search.belief import Belief
from skills.search.course import make_course
from skills.search.decoys import BLIND, NOWHERE, SHALLOW, THROUGH, Decoy, decoy_at
from skills.search.tour import Left
from skills.seating.decision import CLOSED_TOLERANCE

CONFIG = load().cell
JOB, PARAMS = CONFIG.job(), CONFIG.plan().search
HOLE, WIDTH = JOB.hole, JOB.hole.part.inscribed
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
def test_a_peg_far_above_the_bottom_or_below_it_is_in_a_decoy(depth, radius):
    assert decoy_at(PLACE, PLACE, depth, HOLE) == (None if radius is None else Decoy(PLACE, radius))


@pytest.mark.parametrize(("strayed", "is_held"), [(0.99 * THROUGH * WIDTH, True), (1.01 * THROUGH * WIDTH, False)])
def test_a_peg_that_has_strayed_is_in_no_decoy(strayed, is_held):
    decoy = decoy_at((PLACE[0] + strayed, PLACE[1]), PLACE, 0.0, HOLE)
    assert (decoy is not None) is is_held


def course_past(seed, path=None, since=0.0):
    """Return the course after a decoy at `PLACE`."""
    left = None if path is None else Left(path, since)
    return make_course(PARAMS, JOB, np.random.default_rng(seed), Belief().past(Decoy(PLACE, WIDTH), left))


def away(course, time):
    """Return the distance of the peg's lowest point from the decoy at a time along the path, m."""
    return math.dist(course.path.at(time)[0] + course.decoys.offset, PLACE)


@pytest.mark.parametrize("seed", range(4))
def test_every_lane_that_meets_a_decoy_goes_on_behind_it(seed):
    course = course_past(seed)
    inside = [time for time in np.arange(0.0, course.decoys.until, 0.02) if away(course, time) < WIDTH]
    assert inside
    for time in inside:
        behind = course.decoys.beyond(course.path, time)
        assert WIDTH <= away(course, behind) < 1.3 * WIDTH or behind >= course.decoys.until


def test_a_search_that_goes_on_comes_down_behind_the_decoy():
    first = course_past(5)
    since = next(time for time in np.arange(0.0, 10.0, 0.02) if away(first, time) < WIDTH)
    course = course_past(6, first.path, float(since))
    assert course.since > 0.0
    assert away(course, course.since) >= WIDTH
    assert course.first[:2] == pytest.approx(course.middle + course.path.at(course.since)[0])


def test_a_hole_that_was_taken_for_a_decoy_is_tried_again_after_one_cover():
    course = course_past(7)
    later = next(time for time in np.arange(course.decoys.until, 30.0, 0.02) if away(course, time) < WIDTH)
    assert course.decoys.beyond(course.path, float(later)) == later


def test_without_decoys_the_path_is_followed_as_it_is():
    assert NOWHERE.beyond(course_past(8).path, 1.0) == 1.0
