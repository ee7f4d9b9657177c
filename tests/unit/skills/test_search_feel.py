"""Evidence of an edge by the height of the plate, also where little of it was felt yet."""

from types import SimpleNamespace

import numpy as np
import pytest

from cell.config.load import load
from skills.catalogue import SEARCH
from skills.search.belief import Belief
from skills.search.course import make_course
from skills.search.feel import FAINT, LATE, LIKELY, Evidence
from skills.search.surface import SurfaceEstimate
from skills.search.tour import GATE, Likely

CONFIG = load().cell
JOB, PARAMS = CONFIG.job(), CONFIG.params(SEARCH)
PERIOD, SPEED, RUN_UP = 0.01, 0.14, 0.15


def blind(height: float = 0.0) -> SimpleNamespace:
    """Return an observation without a frame, of a hand at this height, m: heights alone are asked."""
    tcp = SimpleNamespace(position=np.array([0.0, 0.0, height]))
    return SimpleNamespace(is_new_frame=False, arm=SimpleNamespace(tcp=tcp))


BLIND = blind()


def felt(
    dip: float,
    scans: int,
    *,
    is_likely: bool = False,
    slope: float = 0.0,
    with_hand: float = 1.0,
    lasting: int = 3,
    in_vain: int = 0,
) -> float:
    """Return the largest depth below the estimate, m, or infinity where it was evidence, of an edge that runs up from rest over a
    plate, down its slope, and after so many scans falls by `dip`, m, within `lasting` scans and stays there for five.

    The hand goes down by `with_hand` of what the edge does. The search has rested `in_vain` so many times.
    """
    evidence = Evidence(PARAMS, SurfaceEstimate(), PERIOD)
    for _ in range(in_vain):
        evidence.doubt()
    place, deepest = 0.0, 0.0
    for k in range(scans + lasting + 5):
        place += PERIOD * SPEED * min(k * PERIOD / RUN_UP, 1.0)
        edge = np.array([0.0, place, -slope * place - dip * min(max(k - scans, 0) / lasting, 1.0)])
        below, is_edge = evidence.update(blind(with_hand * edge[2]), edge, 1, is_likely)
        if is_edge:
            return np.inf
        deepest = max(deepest, below)
        evidence.learn(edge, 1)
    return deepest


def test_a_shallow_fall_right_after_the_run_up_is_seen_where_the_hole_is_likely():
    assert felt(5e-4, 15, is_likely=True) == np.inf


@pytest.mark.parametrize("scans", [8, 15, 30])
def test_a_fall_on_the_first_lane_is_seen_before_the_plate_is_known(scans):
    assert felt(5e-4, scans, is_likely=False) == np.inf


@pytest.mark.parametrize("scans", [15, 300])
def test_an_edge_that_drops_without_the_hand_has_not_fallen(scans):
    assert felt(0.9 * PARAMS.dip_threshold, scans, with_hand=0.2) < np.inf


def test_a_sudden_fall_of_less_than_the_dip_threshold_is_evidence_of_an_edge():
    assert FAINT < 0.75
    assert felt(0.75 * PARAMS.dip_threshold, 300) == np.inf


def test_a_fall_that_is_as_deep_but_slow_is_not():
    assert felt(0.75 * PARAMS.dip_threshold, 300, lasting=20) < np.inf


def test_after_two_stops_without_a_hole_only_a_whole_dip_counts():
    """A sudden fall of less than the dip threshold is then no evidence of an edge."""
    assert [felt(0.95 * PARAMS.dip_threshold, 300, in_vain=n) for n in range(2)] == [np.inf, np.inf]
    assert felt(0.95 * PARAMS.dip_threshold, 300, in_vain=2) < np.inf
    assert felt(1.5 * PARAMS.dip_threshold, 300, in_vain=9) == np.inf


def test_a_plate_that_leans_by_two_degrees_is_no_fall_before_it_is_known():
    assert felt(0.0, 90, is_likely=False, slope=0.035) < np.inf


def test_a_level_plate_is_no_evidence_where_the_hole_is_likely():
    assert felt(0.0, 60, is_likely=True) <= 0.0


def test_a_fall_under_way_does_not_take_the_estimate_with_it():
    """The rest below the full dip is the uncertainty of slopes that were never touched."""
    evidence = Evidence(PARAMS, SurfaceEstimate(), PERIOD)
    for k in range(40):
        evidence.learn(np.array([0.0, 1e-3 * k, 0.0]), 1)
    before, _ = evidence.update(BLIND, np.array([0.0, 0.04, -5e-4]), 1)
    for k in range(round(LATE / PERIOD)):
        evidence.learn(np.array([0.0, 0.04 + 1e-3 * k, -5e-4]), 1)
    after, _ = evidence.update(BLIND, np.array([0.0, 0.04, -5e-4]), 1)
    assert after == pytest.approx(before, abs=5e-5)


def test_elsewhere_the_whole_threshold_counts():
    dip = 0.75 * PARAMS.dip_threshold
    assert LIKELY < 0.75
    known = SurfaceEstimate()
    for k in range(400):
        known.learn(np.array([0.0, 1e-3 * (k % 60), 0.0]), 1)
    evidence = Evidence(PARAMS, known, PERIOD)
    edge = np.array([0.0, 0.03, -dip - 1e-4])
    assert [evidence.update(BLIND, edge, 1, is_likely)[1] for is_likely in (False, True)] == [False, True]


def test_where_a_corner_leads_the_whole_threshold_counts_everywhere():
    params = CONFIG.corner.searching(PARAMS)
    known = SurfaceEstimate()
    for k in range(400):
        known.learn(np.array([1e-3 * (k % 60), 0.0, 0.0]), 1)
    evidence = Evidence(params, known, PERIOD)
    for dip, is_told in ((0.75, False), (1.5, True)):
        edge = np.array([0.03, 0.0, -dip * params.dip_threshold])
        assert evidence.update(BLIND, edge, 1, is_likely=True)[1] is is_told


def test_the_likely_place_is_passed_when_the_whole_threshold_counts_again():
    deviation = 7e-4
    at = (JOB.hole.centre[0] + 0.01, JOB.hole.centre[1] - 0.01)
    belief = Belief(Likely(at, (deviation, deviation)))
    course = make_course(PARAMS, JOB, np.random.default_rng(3), belief)
    first, last = (course.path.at(time)[0] - (0.01, -0.01) for time in (0.0, course.likely_until))
    beyond = GATE * deviation + JOB.hole.part.inscribed / 2
    assert last[course.fast] * -np.sign(first[course.fast]) == pytest.approx(beyond, abs=1e-6)


def test_a_search_that_knows_nothing_has_no_likely_place():
    assert make_course(PARAMS, JOB, np.random.default_rng(3)).likely_until == 0.0
