"""Setpoints of the insertion, scan by scan, and its endings; the test sets the pose of the hand and of the peg."""

import math

import numpy as np
import pytest

from cell.config.load import load
from drivers.errors import SwitchUnknownError
from drivers.frames import UP, angle_between, rotation_about
from drivers.quantities import Pose, SwitchState, Vector
from skills.catalogue import INSERT
from skills.contract import Outcome, Reason
from skills.insert.play import allowed_depth
from skills.insert.tactile_insert import TactileInsertResult, run
from skills.motion import STRAY, VALIDITY
from skills.search.surface import Plane
from tests import scripted
from tests.fakes import PERIOD, Rig
from tests.scripted import CELL, HOLE, LIGHT, SIDE, ScriptedHand

PARAMS, PEG = CELL.params(INSERT), CELL.peg
TILT = 0.5
"""Lean of a peg that the search has left in the hole's mouth, rad."""
DIP = 1e-3
"""Depth of its tip, m."""
FELT = rotation_about(np.array([0.0, 1.0, 0.0]), 0.04) @ UP
"""Normal of a plate that is not level."""


def hand(tilt: float = TILT, tip: Vector = HOLE - DIP * UP, about: Vector = SIDE) -> Pose:
    """Return the hand whose peg leans by `tilt`, rad, about an axis, with its tip at `tip`, m."""
    return scripted.hand(tip, tilt, about)


class Bench(ScriptedHand):
    """The insertion over a hand whose peg stands in the hole's mouth by default."""

    def __init__(self, rig: Rig) -> None:
        super().__init__(rig, lambda time: hand())

    def insert(self, plane: Plane | None = None, attempt: int = 0, **changes: object) -> TactileInsertResult:
        """Run the insertion with these parameters beside the shipped ones."""
        self.move()
        least = self.rig.cell.config.plan(attempt).insert.least_depth
        return run(PARAMS.model_copy(update={"timeout": 0.5, "least_depth": least, **changes}), self.ctx, plane)


@pytest.fixture
def bench(tmp_path):
    return Bench(Rig(load(sets=[LIGHT]), tmp_path))


@pytest.mark.parametrize("normal", [UP, FELT])
def test_the_axis_goes_from_where_the_peg_is_to_the_felt_normal_at_the_turn_rate(bench, normal):
    rate, run_up = 1.5, 0.1
    bench.insert(Plane(HOLE, normal), turn_rate=rate, turn_run_up=run_up)
    start = bench.seen[0].axis
    about = np.cross(start, normal)
    about /= np.linalg.norm(about)
    for scan, setpoint in enumerate(bench.commanded):
        time = scan * PERIOD
        turned = rate * (time**2 / (2 * run_up) if time < run_up else time - run_up / 2)
        spin = rate * min(time / run_up, 1.0)
        np.testing.assert_allclose(setpoint.axis, rotation_about(about, turned) @ start, atol=1e-12)
        np.testing.assert_allclose(setpoint.twist.angular, spin * about, atol=1e-12)
        np.testing.assert_array_equal(setpoint.twist.linear, np.zeros(3))


@pytest.mark.parametrize("normal", [UP, FELT])
def test_insertion_ends_when_its_setpoint_is_upright(bench, normal):
    rate, run_up = 2.0, 0.1
    ended = bench.insert(Plane(HOLE, normal), turn_rate=rate, turn_run_up=run_up)
    whole = angle_between(bench.seen[0].axis, normal)
    assert (ended.outcome, ended.phi) == (Outcome.SUCCESS, pytest.approx(whole))
    assert ended.elapsed == pytest.approx(whole / rate + run_up / 2, abs=PERIOD)
    assert angle_between(bench.commanded[-1].axis, normal) <= rate * PERIOD


def test_insertion_without_a_felt_plate_goes_to_the_vertical(bench):
    bench.insert(turn_rate=2.0, turn_run_up=0.05)
    assert angle_between(bench.commanded[-1].axis, UP) <= 2.0 * PERIOD


def test_leaning_peg_above_the_hole_is_not_handed_on(bench):
    bench.way = lambda time: hand(tip=HOLE + PEG.part.reach * math.sin(TILT) * UP)
    assert bench.insert(turn_rate=2.0, turn_run_up=0.1).reason is Reason.NOT_ALIGNED
    assert 0.2 < bench.seen[-1].elapsed < 0.5


def test_one_motion_keeps_the_hands_roll_the_gains_and_the_integral_of_its_recipe(bench):
    bench.skin.theta = 0.2
    bench.insert(integral_gain=4.0, integral_limit=2.0)
    first = bench.seen[0].arm.tcp.rotation[:, 2]
    assert len({setpoint.id for setpoint in bench.commanded}) == 1
    for seen, setpoint in zip(bench.seen, bench.commanded, strict=True):
        np.testing.assert_array_equal(setpoint.roll, first)
        np.testing.assert_array_equal(
            np.delete(setpoint.stiffness, 2), [PARAMS.gains.translation] * 2 + [PARAMS.gains.rotation] * 3
        )
        np.testing.assert_array_equal(setpoint.damping_ratio, np.full(6, PARAMS.gains.damping_ratio))
        assert setpoint.valid_until == seen.stamp + VALIDITY
        assert (setpoint.integral_gain, setpoint.integral_limit) == (4.0, 2.0)
        assert (setpoint.in_hand.theta, setpoint.in_hand.length) == (seen.peg.theta, PEG.length)


def test_two_insertions_are_two_motions(bench):
    bench.insert()
    bench.insert()
    assert len({setpoint.id for setpoint in bench.commanded}) == 2


def test_the_push_is_that_of_equation_7_from_the_first_tilt_on_towards_a_place_below_the_surface(bench):
    low, high, below = 300.0, 1200.0, 0.012
    bench.way = lambda time: hand(0.6 - 0.6 * time)
    bench.insert(push_stiffness=(low, high), push_offset=below)
    for seen, setpoint in zip(bench.seen, bench.commanded, strict=True):
        share = angle_between(seen.axis, UP) / angle_between(bench.seen[0].axis, UP)
        assert setpoint.stiffness[2] == pytest.approx(high * (low / high) ** share)
        assert setpoint.tip[2] == pytest.approx(HOLE[2] - below)
    assert bench.commanded[-1].stiffness[2] > 1.5 * low  # and each setpoint keeps its own
    assert bench.commanded[0].stiffness[2] == pytest.approx(low)


@pytest.mark.parametrize("about", [SIDE, np.array([0.6, -0.8, 0.0])])
def test_the_setpoint_of_the_tip_stands_ahead_towards_the_side_that_the_peg_leans_to(bench, about):
    bench.way = lambda time: hand(about=about)
    bench.insert(forward=2e-3)
    lean = bench.seen[0].axis[:2]
    np.testing.assert_allclose(bench.commanded[0].tip[:2] - HOLE[:2], 2e-3 * lean / np.linalg.norm(lean), atol=1e-9)


def test_the_setpoint_of_an_upright_peg_stands_nowhere_ahead(bench):
    bench.way = lambda time: hand(0.0)
    bench.insert(Plane(HOLE, rotation_about(SIDE, 0.2) @ UP), forward=2e-3)
    np.testing.assert_allclose(bench.commanded[0].tip[:2], HOLE[:2], atol=1e-9)


@pytest.mark.parametrize("rate", [0.0, 10.0, 1e3])
def test_the_setpoint_gives_way_to_where_the_hole_keeps_the_tip_at_the_compliance_rate(bench, rate):
    step = np.array([1e-3, -2e-3, 0.0])
    bench.way = lambda time: hand(tip=HOLE - DIP * UP + (step if time > 1e-9 else 0.0))
    bench.insert(compliance_rate=rate, forward=0.0)
    for scan, setpoint in enumerate(bench.commanded):
        left = max(1.0 - rate * PERIOD, 0.0) ** scan
        np.testing.assert_allclose(setpoint.tip[:2], (HOLE + (1.0 - left) * step)[:2], atol=1e-9)


@pytest.mark.parametrize(("diameter", "furthest"), [(0.004, STRAY), (0.012, 0.006)])
def test_a_tip_that_strays_is_followed_no_further_than_a_hole_can_be_or_half_the_pegs_breadth(
    tmp_path, diameter, furthest
):
    sizes = [f"peg.diameter={diameter}", f"hole.diameter={diameter + 1e-4}"]
    bench = Bench(Rig(load(sets=[LIGHT, *sizes]), tmp_path))
    bench.way = lambda time: hand(tip=HOLE - DIP * UP + (0.01 * SIDE if time > 1e-9 else 0.0))
    bench.insert(compliance_rate=1e3, forward=0.0)
    assert bench.commanded[-1].tip[0] - HOLE[0] == pytest.approx(furthest)


def test_the_hand_turns_after_a_peg_that_has_turned_in_it_at_the_follow_rate(bench):
    rate, turn = 4.0, 0.2
    # The hand turns against the peg, so that the peg's axis, and with it everything else, stays as it was.
    bench.rig.clock.at.append((0.1 - 1e-9, lambda: setattr(bench.skin, "theta", turn)))
    bench.insert(follow_rate=rate, turn_rate=1e-6, turn_run_up=0.0)
    start, closing = bench.seen[0].axis, bench.seen[0].arm.tcp.rotation[:, 2]
    behind = 0.0
    for before, seen, setpoint in zip([bench.seen[0], *bench.seen], bench.seen, bench.commanded, strict=False):
        behind = (behind + seen.peg.theta - before.peg.theta) * (1.0 - rate * seen.step)
        np.testing.assert_allclose(setpoint.axis, rotation_about(closing, behind) @ start, atol=2e-6)
    assert max(abs(seen.peg.theta) for seen in bench.seen) == turn
    assert 0.01 < behind < 0.1


def test_progress_is_the_share_of_the_tilt_that_is_gone_and_never_negative(bench):
    bench.way = lambda time: hand(TILT + 0.1 if 0.0 < time < 0.1 else TILT - 0.5 * time)
    bench.insert()
    expected = [1.0 - min(angle_between(seen.axis, UP) / TILT, 1.0) for seen in bench.seen]
    assert bench.progress == pytest.approx(expected)
    assert min(bench.progress) == 0.0 < max(bench.progress)


def test_a_switch_that_closes_at_the_holes_depth_ends_an_insertion_well(bench):
    bench.rig.switch.state = SwitchState.CLOSED
    bench.way = lambda time: hand(tip=HOLE - CELL.hole.depth * UP)
    ended = bench.insert()
    assert (ended.outcome, ended.reason, ended.elapsed) == (Outcome.SUCCESS, Reason.NONE, 0.0)
    assert (ended.first_phi, ended.phi) == pytest.approx((TILT, TILT))
    assert not bench.commanded


def test_a_peg_that_the_hand_loses_ends_it_at_once_with_the_arm_halted(bench):
    assert bench.lost_in(bench.insert) is Reason.LOST_GRASP
    assert len(bench.commanded) == pytest.approx(0.1 / PERIOD, abs=1)


def test_a_switch_that_does_not_answer_ends_it_with_its_name(bench):
    bench.rig.switch.state = SwitchState.UNKNOWN
    with pytest.raises(SwitchUnknownError, match="switch"):
        bench.insert()


LEAST = PARAMS.least_share * allowed_depth(PARAMS.aligned, PEG.part.thickness, CELL.hole.part.thickness)
"""Depth of its lowest point at which an aligned peg is in the hole by the recipe, m."""
NEARLY = 0.09
"""Lean of an aligned peg, rad."""
BELOW = PEG.part.reach * math.sin(NEARLY)
"""Depth of its lowest point below its tip, m."""


@pytest.mark.parametrize(
    ("depth", "attempt", "reason"),
    [
        (LEAST - BELOW + 1e-5, 0, Reason.NONE),
        (LEAST - BELOW - 1e-5, 0, Reason.NOT_ALIGNED),
        (-1e-3, 1, Reason.NONE),
    ],
)
def test_a_first_attempt_hands_on_a_peg_as_deep_as_its_lean_allows(bench, depth, attempt, reason):
    bench.way = lambda time: hand(TILT if time < 0.1 else NEARLY, HOLE - depth * UP)
    ended = bench.insert(attempt=attempt)
    assert ended.reason is reason
    assert ended.outcome is (Outcome.SUCCESS if reason is Reason.NONE else Outcome.FAILURE)
    assert (ended.elapsed, ended.first_phi, ended.phi) == pytest.approx((0.1, TILT, NEARLY), abs=PERIOD + 1e-9)


def test_a_hole_that_is_shallower_than_the_lean_allows_asks_for_no_more_than_its_depth(tmp_path):
    bench = Bench(Rig(load(sets=[LIGHT, "hole.depth=0.002", "hole.diameter=0.009"]), tmp_path))
    bench.way = lambda time: hand(NEARLY, HOLE - (PARAMS.least_share * 0.002 - BELOW + 1e-5) * UP)
    assert bench.insert().outcome is Outcome.SUCCESS


def test_a_peg_is_aligned_below_the_recipes_tilt_and_not_above(bench):
    bench.way = lambda time: hand(PARAMS.aligned + 1e-6 - (2e-6 if time > 0.2 else 0.0), HOLE - 2e-3 * UP)
    assert bench.insert().elapsed == pytest.approx(0.2, abs=PERIOD + 1e-9)


@pytest.mark.parametrize(("above", "goes_on"), [(-1e-5, True), (1e-5, False)])
def test_a_peg_whose_rim_is_above_the_lost_height_is_out_of_the_hole(bench, above, goes_on):
    height = PARAMS.lost_height + PEG.part.reach * math.sin(TILT) + above
    bench.way = lambda time: hand(tip=HOLE + height * UP)
    ended = bench.insert()
    assert (ended.outcome, ended.reason) == (Outcome.FAILURE, Reason.NOT_ALIGNED)
    assert bool(bench.commanded) == goes_on
    assert (ended.first_phi, ended.phi) == pytest.approx((TILT, TILT))
    assert ended.elapsed == pytest.approx(0.5 if goes_on else 0.0)


def test_depth_counts_from_the_felt_plate(bench):
    raised = Plane(HOLE - 0.02 * UP, UP)
    assert bench.insert(raised).reason is Reason.NOT_ALIGNED
    assert not bench.commanded


def test_an_insertion_that_takes_too_long_tells_its_last_tilt(bench):
    bench.way = lambda time: hand(TILT - 0.2 * time)
    ended = bench.insert(timeout=0.3)
    assert (ended.outcome, ended.reason, ended.elapsed) == (Outcome.FAILURE, Reason.NOT_ALIGNED, 0.3)
    assert (ended.first_phi, ended.phi) == pytest.approx((TILT, TILT - 0.2 * 0.29), abs=3e-3)
