"""How a search goes and ends, over a plate with a hole on which the hand is at once where it shall be."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP, angle_between
from drivers.parts import HolePrior
from drivers.quantities import Pose, Wrench
from skills.catalogue import SEARCH
from skills.contract import Outcome, Reason
from skills.held_peg import EXPLAINED, HeldPeg
from skills.pull_out import LONGEST
from skills.search.belief import Belief
from skills.search.course import ANYWHERE, make_course
from skills.search.feel import EdgeEvidence
from skills.search.spray_search import run
from skills.search.surface import Plane
from skills.search.tour import Left
from tests.board import Board
from tests.fakes import HAND_DOWN, PERIOD, Rig
from tests.scripted import LIGHT

LOADED = load(sets=["hole.area=[0.02, 0.02]", LIGHT])
CELL, PARAMS = LOADED.cell, LOADED.cell.params(SEARCH)
HOLE, RADIUS = np.array(CELL.hole.centre), CELL.hole.part.inscribed / 2


class Bench(Board):
    """A search over a level plate, by default without a hole, by a hand that is there already."""

    def __init__(self, rig):
        super().__init__(rig)
        self.put(HOLE + 0.02 * UP, *self.part.leaning(PARAMS.tilt_azimuth, 0.9 * PARAMS.tilt))

    def search(self, belief=ANYWHERE, **changes):
        """Run the search with these parameters beside the shipped ones."""
        return run(PARAMS.model_copy(update={"timeout": 2.0, **changes}), self.ctx, belief)

    @property
    def free_moves(self):
        """Setpoints of free moves, by their motions in turn."""
        moves = {}
        for setpoint in self.commanded:
            if setpoint.is_free:
                moves.setdefault(setpoint.id, []).append(setpoint)
        return list(moves.values())


@pytest.fixture
def bench(tmp_path):
    return Bench(Rig(LOADED, tmp_path))


def test_a_search_finds_the_hole_on_its_lanes(bench):
    hole = bench.dig(0.0, 0.0)
    bench.free = np.array([3.0, -2.0, 5.0])
    bench.rig.arm.force = bench.free
    ended = bench.search(timeout=20.0)
    assert (ended.outcome, ended.reason, ended.rests) == (Outcome.SUCCESS, Reason.NONE, 1)
    assert math.dist(ended.edge, hole) < 4.1e-3 + PARAMS.probe_radius  # no rim holds the peg of this bench
    assert ended.tip == pytest.approx(tuple(bench.seen[-1].tip))
    lowest = bench.part.lowest(bench.seen[-1].tip, bench.seen[-1].axis, bench.seen[-1].arm.tcp.rotation[:, 2])
    assert (*ended.edge, bench.level - 2e-3) == pytest.approx(tuple(lowest), abs=1e-9)
    assert ended.elapsed == pytest.approx(bench.seen[-1].running)
    assert bench.progress[-1] == pytest.approx(ended.left.since / ended.left.path.cover, abs=0.01)
    assert (np.diff(bench.progress) >= 0.0).all()
    assert (*ended.offset, ended.noise) == pytest.approx((3.0, -2.0, 5.0, 0.0))
    assert ended.excess == 0.0
    assert ended.start + ended.left.path.at(ended.left.since)[0] == pytest.approx(
        np.array(ended.tip[:2]) + ended.left.path.at(0.0)[0], abs=2e-3 + PARAMS.probe_radius
    )
    assert ended.plane.point == pytest.approx([*ended.tip[:2], bench.level], abs=1e-4)
    assert angle_between(ended.plane.normal, UP) < 1e-3


@pytest.mark.parametrize("is_known", [False, True])
def test_the_course_follows_the_generator_and_the_known_length(bench, is_known):
    bench.ctx.rng, bench.ctx.peg = np.random.default_rng(5), HeldPeg(measured=0.0 if is_known else None)
    ended = bench.search(timeout=0.05)
    course = make_course(PARAMS, CELL.job(), np.random.default_rng(5), is_length_known=is_known)
    assert bench.commanded[0].is_free  # a peg above the plate is not pulled
    assert ended.start == pytest.approx(tuple(course.first[:2]))
    last = bench.free_moves[0][-1]
    for told, asked in ((last.tip, course.first), (last.axis, course.axis), (last.roll, course.closing)):
        np.testing.assert_allclose(told, asked, atol=1e-5)
    assert (last.in_hand.theta, last.in_hand.length) == (0.0, bench.length)
    np.testing.assert_array_equal(last.stiffness, PARAMS.transfer.stiffness())


def test_behind_the_first_cover_nothing_is_left_to_cover(bench):
    path = make_course(PARAMS, CELL.job(), np.random.default_rng(5)).path
    bench.search(belief=replace(ANYWHERE, left=Left(path, path.cover)), timeout=0.5)
    assert set(bench.progress) == {1.0}


def test_a_search_without_a_hole_ends_at_its_time(bench):
    ended = bench.search()
    assert (ended.outcome, ended.reason, ended.elapsed) == (Outcome.FAILURE, Reason.NO_HOLE, 2.0)
    assert (ended.rests, ended.plane, ended.left) == (0, None, None)
    assert ended.tip == pytest.approx(tuple(bench.ctx.observe().tip))
    assert len(bench.progress) == round(2.0 / PERIOD)
    np.testing.assert_allclose(ended.start, bench.free_moves[0][-1].tip[:2], atol=1e-5)


class Sunken(EdgeEvidence):
    """Evidence by which the plate has sunk by `sunk`, m, since the touch-down, and leans by `tilt`, rad."""

    sunk = tilt = 0.0
    touched = None

    def update(self, seen, edge, is_likely=False):
        if self.touched is None and edge[2] < HOLE[2] + 1e-6:
            self.touched = edge
        return super().update(seen, edge, is_likely)

    def plane(self, near):
        return Plane(self.touched - self.sunk * UP, np.array([-math.sin(self.tilt), 0.0, math.cos(self.tilt)]))


@pytest.mark.parametrize(
    ("slip", "tilt", "is_felt", "excess"),
    [
        (0.003, 0.0, True, -0.003),
        (0.003, 0.1, True, -0.003),
        (0.0, -0.1, True, 0.0),
        (0.99 * EXPLAINED, 0.0, True, 0.0),
        (0.003, 0.0, False, 0.0),
    ],
    ids=["slip", "slip on a tilted plate", "tilted plate", "explained by other errors", "plate never felt"],
)
def test_a_slip_since_the_touch_down_shortens_the_peg(bench, monkeypatch, slip, tilt, is_felt, excess):
    bench.dig(0.0, 0.0)
    read, sunk = bench.rig.arm.read, slip * math.cos(PARAMS.tilt)
    if not is_felt:
        bench.rig.arm.read = lambda: replace(read(), wrench=Wrench(np.zeros(3), np.zeros(3)))
    monkeypatch.setattr(Sunken, "sunk", sunk)
    monkeypatch.setattr(Sunken, "tilt", tilt)
    found = run(PARAMS.model_copy(update={"timeout": 20.0}), bench.ctx, make_evidence=Sunken)
    assert found.excess == bench.ctx.peg.excess == pytest.approx(excess)
    assert found.plane.point[2] - bench.level == pytest.approx(-sunk - excess * math.cos(PARAMS.tilt), abs=1e-6)


def in_the_hole(deep=0.02):
    """Return the hand whose straight peg stands so deep, m, in the middle of the area."""
    return Pose(HOLE + (CELL.peg.length - deep) * UP, HAND_DOWN)


def test_a_peg_stuck_in_the_hole_ends_the_search_at_once(bench):
    bench.rig.arm.tcp, bench.rig.arm.is_blocked = in_the_hole(), True
    ended = bench.search()
    assert (ended.outcome, ended.reason, ended.elapsed) == (Outcome.FAILURE, Reason.NOT_SEATED, LONGEST)
    assert ended.tip == pytest.approx((*HOLE[:2], HOLE[2] - 0.02))
    course = make_course(PARAMS, CELL.job(), bench.rig.cell.context(1).rng, is_length_known=False)
    assert ended.start == pytest.approx(tuple(course.first[:2]))
    assert (ended.rests, ended.plane) == (0, None)
    assert not bench.free_moves
    np.testing.assert_array_equal(bench.commanded[0].stiffness, PARAMS.transfer.gains.stiffness())


def test_a_peg_in_the_hole_is_first_pulled_straight_up(bench):
    bench.rig.arm.tcp = in_the_hole()
    bench.search(timeout=0.05)
    pulled = [each for each in bench.commanded if each.in_hand is not None and each.id == bench.commanded[0].id]
    assert not any(each.is_free for each in pulled)
    np.testing.assert_allclose([each.tip[:2] for each in pulled], [HOLE[:2]] * len(pulled), atol=1e-3)
    assert pulled[-1].tip[2] - bench.level == pytest.approx(PARAMS.first_height(bench.part.reach), abs=1e-3)


TURN = 0.4
"""Turn of the peg in the hand beyond what the search bears, rad."""


def turned_after(bench, delay, is_blocked=False):
    """Let the peg turn in the hand, and the arm be blocked, once the search has slid for so long, s."""
    start = bench.ctx.callbacks.progress

    def told(share):
        start(share)
        if len(bench.progress) == round(delay / PERIOD):
            bench.skin.theta, bench.rig.arm.is_blocked = TURN, is_blocked

    bench.ctx.callbacks = replace(bench.ctx.callbacks, progress=told)


def test_a_peg_that_turns_far_is_lifted_and_held_anew(bench):
    turned_after(bench, 1.0)
    ended = bench.search(timeout=4.0)
    (first, again), pulled = bench.free_moves, [each for each in bench.commanded if not each.is_free]
    assert (ended.elapsed, ended.reason) == (4.0, Reason.NO_HOLE)
    np.testing.assert_allclose(again[-1].axis, first[-1].axis, atol=1e-9)
    assert (first[-1].in_hand.theta, again[-1].in_hand.theta) == (0.0, TURN)
    assert math.dist(again[-1].tip[:2], first[-1].tip[:2]) > 0.005
    assert max(each.tip[2] for each in pulled) > again[-1].tip[2] - 1e-3
    after = [each for each in bench.commanded if each.id > again[-1].id]
    assert after
    np.testing.assert_allclose(after[0].tip[:2], again[-1].tip[:2], atol=1e-3)
    assert after[0].in_hand.theta == TURN


def test_a_search_can_time_out_while_the_peg_is_lifted(bench):
    turned_after(bench, 1.0)
    ended = bench.search(timeout=1.3)
    assert (ended.reason, ended.elapsed) == (Reason.NO_HOLE, 1.3)


def test_a_turned_peg_stuck_on_the_plate_ends_the_search(bench):
    turned_after(bench, 0.8, is_blocked=True)
    ended = bench.search()
    assert (ended.outcome, ended.reason) == (Outcome.FAILURE, Reason.NOT_SEATED)
    assert ended.elapsed == pytest.approx(0.8 + LONGEST, abs=0.05)
    assert ended.tip == pytest.approx(tuple(bench.seen[-1].tip))
    np.testing.assert_allclose(ended.start, bench.free_moves[0][-1].tip[:2], atol=1e-5)
    assert (ended.rests, ended.plane) == (0, None)


PLACE = (float(HOLE[0]) + 6e-3, float(HOLE[1]) - 5e-3)
PRIOR = HolePrior(mean=PLACE, deviation=(3e-4, 5e-4))
KNOWN = Belief(HolePrior(mean=PLACE, deviation=(5e-4, 5e-4)))


@pytest.mark.parametrize(
    ("prior", "belief", "followed"),
    [(PRIOR, ANYWHERE, Belief(PRIOR)), (PRIOR, Belief(failed=(PLACE,)), ANYWHERE), (None, KNOWN, KNOWN)],
    ids=["first attempt", "later attempt", "belief without a prior"],
)
def test_the_prior_of_a_job_leads_a_first_attempt_alone(bench, prior, belief, followed):
    hole = bench.ctx.job.hole.model_copy(update={"prior": prior})
    bench.ctx.job = bench.ctx.job.model_copy(update={"hole": hole})
    bench.ctx.rng = np.random.default_rng(2)
    course = make_course(PARAMS, CELL.job(), np.random.default_rng(2), followed, False)
    assert bench.search(belief=belief, timeout=0.05).start == pytest.approx(tuple(course.first[:2]))


def test_a_peg_that_the_hand_loses_ends_the_search(bench):
    assert bench.lost_in(lambda: bench.search(timeout=4.0), after=2.5) is Reason.LOST_GRASP
