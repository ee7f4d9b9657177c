"""The hand on its way over the plate, while the peg turns in it."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP, angle_between, end_point
from skills.catalogue import SEARCH
from skills.held_peg import HeldPeg
from skills.motion import VALIDITY
from skills.search.course import make_course
from skills.search.feel import EdgeEvidence
from skills.search.surface import SurfaceEstimate
from skills.search.sweep import SearchSweep
from tests.board import Board
from tests.fakes import PERIOD, Rig
from tests.scripted import LIGHT, SIDE

LOADED = load(sets=[LIGHT])
PARAMS, JOB = LOADED.cell.params(SEARCH), LOADED.cell.job()


class Slide(Board):
    """A search from above its first point on, over a plate on which the hand is at once where it shall be."""

    def begin(self, known=False, **keys):
        """Put the hand above the first point of a course along lanes, and begin; return the search and an observation."""
        self.params = PARAMS.model_copy(update={"trim_rate": 0.0, **keys})
        self.ctx.peg = HeldPeg(measured=0.0 if known else None)
        self.course = course = make_course(self.params, self.ctx.job, np.random.default_rng(1))
        self.put(course.first, course.axis, course.closing)
        evidence = EdgeEvidence(self.params, SurfaceEstimate(), PERIOD)
        self.ctx.observe()
        self.sweep = SearchSweep(self.params, self.ctx, course, evidence)
        self.found = None
        return self.sweep, self.ctx.observe()

    def slide(self, time, known=False, **keys):
        """Begin, and search for so long, s, or until the peg is in the hole."""
        self.begin(known, **keys)
        self.go_on(time)

    def go_on(self, time):
        """Search on for so long, s, or until the peg is in the hole."""
        for seen in self.ctx.scan(time, holding=True):
            if self.sweep.finds(seen):
                self.found = seen
                return
            self.ctx.follow(self.sweep.setpoint(seen))

    def scans(self):
        """Return each observation with the setpoint that followed on it."""
        return list(zip(self.seen, self.commanded, strict=False))

    def ahead(self, time):
        """Return the middle of a place, m, from that of the area, over which the path comes at a time along it, s."""
        place = self.course.middle + self.course.path.at(time)[0]
        return self.part.lowest(np.array([*place, 0.0]), self.course.axis, self.course.closing)[:2] - self.middle


DOWN = math.ceil((PARAMS.height + PARAMS.push_offset) / PARAMS.descent / PERIOD) * PERIOD
"""Time in which the setpoint comes down, s, in whole scans; the path then begins, for the plate has borne the push for a while."""


@pytest.fixture
def slide(tmp_path):
    return Slide(Rig(LOADED, tmp_path))


def turned(seen, theta, length):
    """Return an observation in which the peg has turned in a hand that stands still."""
    tip, axis = end_point(seen.arm.tcp, theta, length)
    return replace(seen, peg=replace(seen.peg, theta=theta), tip=tip, axis=axis)


@pytest.mark.parametrize(("most", "angle", "is_turned"), [(0.35, 0.34, False), (0.35, 0.36, True), (0.2, 0.21, True)])
def test_a_peg_that_has_turned_far_is_held_anew(slide, most, angle, is_turned):
    sweep, seen = slide.begin(turned=most)
    assert sweep.is_to_lift(turned(seen, seen.peg.theta - angle, slide.ctx.length)) is is_turned


@pytest.mark.parametrize(("lag", "rests"), [(0.99e-2, 0), (1.01e-2, 1)])
def test_a_tip_that_a_wall_holds_back_stops_the_path(slide, lag, rests):
    sweep, seen = slide.begin(lag=1e-2, run_up=1e-6, touch_down=0.2)
    for elapsed in (0.0, 0.3):
        sweep.finds(replace(seen, elapsed=elapsed))
    way = sweep.setpoint(replace(seen, elapsed=0.3))
    tip = seen.tip.copy()
    tip[1] = way.tip[1] - lag
    held = replace(seen, elapsed=0.31, step=0.0, tip=tip)
    sweep.setpoint(held)
    sweep.finds(held)
    assert sweep.rests == rests


def stiffness(gains):
    """Return the stiffness with the shipped push, shape (6,)."""
    return [gains.translation] * 2 + [PARAMS.push_stiffness] + [gains.rotation] * 3


def stopped(slide):
    """Return the observations and setpoints of the scans in which the hand rested."""
    return [(seen, each) for seen, each in slide.scans() if each.in_hand is None]


def heading(slide):
    """Return the direction in which the hand went when it was stopped, unit, shape (3,)."""
    way = next(one.twist.linear for (_, one), (_, other) in itertools.pairwise(slide.scans()) if other.in_hand is None)
    return way / np.linalg.norm(way)


def test_the_peg_comes_down_and_runs_up_in_one_motion(slide):
    """With the gains of its recipe and the peg as it lies in the hand."""
    slide.skin.theta, gains = 0.1, PARAMS.gains
    slide.slide(3.0)
    along, first = 0.0, slide.course.first
    for seen, setpoint in slide.scans():
        height = max(first[2] - PARAMS.descent * seen.running, slide.level - PARAMS.push_offset)
        pace = min(max(seen.running - DOWN, 0.0) / PARAMS.run_up, 1.0)
        point, velocity = slide.course.path.at(along)
        np.testing.assert_allclose(setpoint.tip, [*(slide.course.middle + point), height], atol=1e-9)
        np.testing.assert_allclose(setpoint.twist.linear, [*(pace * velocity), 0.0], atol=1e-9)
        np.testing.assert_array_equal(setpoint.twist.angular, np.zeros(3))
        np.testing.assert_allclose(setpoint.axis, slide.course.axis, atol=1e-9)
        np.testing.assert_allclose(setpoint.roll, slide.course.closing, atol=1e-9)
        np.testing.assert_array_equal(setpoint.stiffness, stiffness(gains))
        np.testing.assert_array_equal(setpoint.damping_ratio, np.full(6, gains.damping_ratio))
        assert setpoint.valid_until == seen.stamp + VALIDITY
        assert (setpoint.in_hand.theta, setpoint.in_hand.length) == (seen.peg.theta, slide.ctx.length)
        along += pace * PERIOD
    assert len({setpoint.id for setpoint in slide.commanded}) == 1
    assert slide.sweep.left.since == pytest.approx(along)
    assert slide.sweep.left.path is slide.course.path
    assert slide.sweep.rests == 0


def speed_of(setpoint):
    return float(np.linalg.norm(setpoint.twist.linear))


@pytest.mark.parametrize("sense", [-1.0, 1.0])
def test_a_slip_in_the_hand_reduces_push_and_pace_alike(slide, sense):
    slide.begin()
    slide.turn(1.5, 0.12 * sense)
    slide.go_on(2.0)
    before, after = (max(slide.commanded[part], key=speed_of) for part in (slice(100, 145), slice(-40, None)))
    assert after.stiffness[2] == pytest.approx(PARAMS.push_back * before.stiffness[2])
    assert speed_of(after) == pytest.approx(PARAMS.push_back * speed_of(before), rel=1e-6)
    assert angle_between(after.axis, before.axis) == pytest.approx(0.12)
    np.testing.assert_allclose(slide.seen[-1].arm.tcp.rotation, slide.seen[0].arm.tcp.rotation, atol=1e-9)


def test_a_dent_stops_the_hand_and_leads_it_back_pushing(slide):
    gains = PARAMS.gains.model_copy(update={"damping_ratio": 1.2})
    slide.begin(gains=gains)
    slide.dig(*slide.ahead(0.3), 3e-3, 0.5e-3)
    slide.go_on(DOWN + 1.0)
    rest = stopped(slide)
    hand, back = rest[0][0].arm.tcp, PARAMS.probe_radius * heading(slide)
    assert len(rest) * PERIOD == pytest.approx(PARAMS.rest, abs=0.11)
    for seen, setpoint in rest:
        np.testing.assert_allclose(setpoint.tip, hand.position - back - PARAMS.push_offset * UP, atol=1e-12)
        np.testing.assert_allclose(setpoint.axis, -hand.rotation[:, 0], atol=1e-12)
        np.testing.assert_allclose(setpoint.roll, hand.rotation[:, 2], atol=1e-12)
        np.testing.assert_array_equal(setpoint.stiffness, stiffness(gains))
        damping = np.array([PARAMS.rest_damping] * 3 + [1.0] * 3) * gains.damping_ratio
        np.testing.assert_array_equal(setpoint.damping_ratio, damping)
        assert setpoint.valid_until == seen.stamp + VALIDITY
    assert {setpoint.id for _, setpoint in rest} == {slide.commanded[0].id}
    assert slide.sweep.rests == 1


def test_after_a_rest_the_place_is_probed_and_the_path_goes_on(slide):
    slide.begin()
    slide.dig(*slide.ahead(0.6), 3e-3, 0.5e-3)
    slide.rig.at(DOWN + 0.9, slide.dents.clear)
    slide.go_on(DOWN + 2.5)
    scans = slide.scans()
    rest = [scan for scan, (_, setpoint) in enumerate(scans) if setpoint.in_hand is None]
    slid = rest[0] - round(DOWN / PERIOD)
    place = scans[rest[0]][0].tip[:2] - PARAMS.probe_radius / 2.0 * heading(slide)[:2]
    probing = [each for _, each in scans[rest[-1] + 1 :] if not each.twist.linear.any()]
    away = [math.dist(each.tip[:2], place) for each in probing]
    assert max(away) == pytest.approx(PARAMS.probe_radius, rel=0.15)  # on what is left of the way back
    steps = [math.dist(one.tip[:2], other.tip[:2]) for one, other in itertools.pairwise(probing)]
    assert np.mean(steps[10:]) == pytest.approx(PARAMS.probe_speed * PERIOD, rel=0.2)
    for seen, setpoint in scans:
        if setpoint.in_hand is not None and seen.running > DOWN:
            assert math.dist(setpoint.tip[:2], seen.tip[:2]) < 1.3 * PARAMS.speed * PERIOD
            assert setpoint.tip[2] == pytest.approx(slide.level - PARAMS.push_offset)
    assert (slide.sweep.rests, slide.found) == (1, None)
    again = len(scans) - rest[-1] - 1 - len(probing)
    # Each time the path runs up, at half its pace in the mean.
    assert slide.sweep.left.since == pytest.approx((slid + again) * PERIOD - PARAMS.run_up, abs=3 * PERIOD)
    path = slide.course.middle + slide.course.path.at(slide.sweep.left.since)[0]
    assert math.dist(slide.seen[-1].tip[:2], path) < 2.5 * PARAMS.speed * PERIOD


@pytest.mark.parametrize(
    ("places", "lifted"), [((0.0, 0.0, 0.0), True), ((0.0, 0.9e-3, 1.8e-3), True), ((0.0, 0.0, 1.1e-3), False)]
)
def test_a_place_of_three_rests_without_a_find_is_lifted_over(slide, monkeypatch, places, lifted):
    """In three observations at each place the peg comes down or ends a probe, is stopped, and has rested."""
    sweep, seen = slide.begin(rest=0.1)
    monkeypatch.setattr(EdgeEvidence, "update", lambda *args: (0.99 * PARAMS.fall, True))
    for time, place in enumerate(np.repeat(places, 3), 10):
        peg = replace(seen.peg, stamp=float(time))
        assert not sweep.finds(replace(seen, stamp=peg.stamp, elapsed=peg.stamp, peg=peg, tip=seen.tip + place * SIDE))
    assert sweep.is_to_lift(seen) is lifted


@pytest.mark.parametrize(
    ("longer", "is_known", "excess", "grip_share"),
    [
        (0.003, False, 0.003, 1.0),
        (-0.003, False, -0.003, 1.0),
        (-0.007, False, 0.0, 1.0),
        (0.0, True, 0.0, 1.0),
        (-0.008, True, -0.008, 0.5),
    ],
    ids=["longer", "shorter", "beyond the bound", "as long as before", "slipped since"],
)
def test_a_touch_down_measures_the_length_of_the_peg_and_its_slip(slide, longer, is_known, excess, grip_share):
    slide.longer = longer
    slide.slide(DOWN + 0.5, known=is_known, touch_down=2.0)
    peg, axis = slide.ctx.peg, slide.course.axis
    assert (peg.excess, peg.is_length_known, peg.grip_share) == (pytest.approx(excess), True, grip_share)
    assert slide.sweep.touched[2] == pytest.approx(slide.level + (longer - excess) * axis[2])
    edge = slide.part.lowest(slide.course.first, axis, slide.course.closing)
    np.testing.assert_allclose(slide.sweep.touched[:2], edge[:2], atol=6e-3)


def test_a_plate_that_is_not_felt_gives_no_length(slide):
    slide.level -= 0.03
    slide.slide(PARAMS.touch_down + 0.2)
    assert slide.commanded[-1].twist.linear.any()
    assert (slide.ctx.peg.is_length_known, slide.sweep.touched) == (False, None)


@pytest.mark.parametrize(("limit", "moved"), [(1.0, 12.0 * 2e-3 * 20 * PERIOD), (1e-3, 1e-3)])
def test_the_setpoint_is_moved_against_a_standing_error_across_the_lanes(slide, limit, moved):
    """The hand stands 2 mm beside the lane; the setpoint is down, and the path stands still."""
    sweep, seen = slide.begin(trim_rate=12.0, trim_limit=limit)
    for sense in (1.0, -1.0):
        sweep.hold_anew()
        aside = replace(seen, elapsed=DOWN, step=PERIOD, tip=seen.tip - 2e-3 * sense * SIDE)
        setpoints = [sweep.setpoint(aside) for _ in range(20)]
        assert setpoints[-1].tip[0] - seen.tip[0] == pytest.approx(sense * moved)
        assert setpoints[-1].tip[1] == pytest.approx(seen.tip[1])


@pytest.mark.parametrize(("more", "is_trimmed"), [(1e-5, False), (-1e-5, True)])
def test_in_the_air_nothing_is_trimmed(slide, more, is_trimmed):
    sweep, seen = slide.begin(trim_rate=12.0)
    elapsed = (slide.course.first[2] - JOB.hole.centre[2] - PARAMS.trimmed_below - more) / PARAMS.descent
    high = replace(seen, elapsed=elapsed, step=PERIOD, tip=seen.tip + 2e-3 * SIDE)
    assert (abs(sweep.setpoint(high).tip[0] - seen.tip[0]) > 1e-5) == is_trimmed


def test_a_peg_held_anew_begins_a_motion_with_the_last_push(slide):
    slide.begin()
    slide.turn(DOWN + 0.5, 0.12)
    slide.go_on(DOWN + 0.7)
    course = slide.sweep.begin_anew()
    assert course.first[:2] == pytest.approx(slide.course.middle + slide.course.path.at(slide.sweep.left.since)[0])
    assert course.first[2] == slide.course.first[2]
    slide.sweep.hold_anew()
    slide.level -= 0.6e-3
    before = len(slide.commanded)
    slide.go_on(DOWN + 1.0)
    again = slide.commanded[before:]
    assert slide.commanded[0].id not in {each.id for each in again}
    assert slide.sweep.rests == 0
    np.testing.assert_allclose(again[0].tip, course.first, atol=1e-9)
    assert {each.stiffness[2] for each in again} == {PARAMS.push_back * PARAMS.push_stiffness}
    np.testing.assert_allclose(again[0].axis, course.axis, atol=1e-9)
