"""Skills that search, align and seat each kind of part, and differences between the attempts of one insertion."""

from dataclasses import replace

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP, angle_between, rotation_about
from drivers.quantities import SwitchState
from skills.catalogue import ADJUST, GRASP, INSERT, SEARCH
from skills.contract import Outcome, Reason
from skills.corner.adjust import CornerAdjustResult
from skills.handling import adjust, insert
from skills.insert.grip import grip_of
from skills.insert.spiral_adjust import SpiralAdjustResult
from skills.plan import FIRST_STALL, plan_insertion
from skills.search.surface import Plane
from tests.fakes import PERIOD, Rig
from tests.scripted import CELL, HOLE, LIGHT, SIDE, SQUARE, ScriptedHand, corner_hand, hand

WEAK = 0.2
"""Share of the shipped grip that bears none of the shipped pushes, fraction."""
RETRIES = 3
LOWER = Plane(HOLE - 0.02 * UP, UP)
"""Plate that was felt 20 mm below where the job has it, so that the peg is far out of its hole."""
FELT = Plane(HOLE, rotation_about(SIDE, 0.04) @ UP)
"""Plate that was felt not to be level."""


def plan(cell=CELL, attempt=0, grip_share=1.0, force=None, inserting=60.0, retries=RETRIES, **adjust):
    """Return the plan of a cell, but for the grip, the longest insertion, s, and these parameters of the adjustment."""
    skills, brief = cell.skill_set(), cell.corner.insert.model_copy(update={"timeout": min(inserting, 6.0)})
    changes = {"grasp": {} if force is None else {"force": force}, "insert": {"timeout": inserting}, "adjust": adjust}
    changed = {name: skills.sections[name].model_copy(update=each) for name, each in changes.items()}
    corner = cell.corner.model_copy(update={"insert": brief})
    skills = replace(skills, sections={**skills.sections, **changed}, corner=corner, retries=retries)
    return plan_insertion(skills, cell.peg, cell.hole, grip_share, attempt)


@pytest.mark.parametrize(
    ("attempt", "retries", "share"), [(0, 4, FIRST_STALL), (1, 4, 1.0), (4, 4, 1.0), (0, 0, 1.0), (0, 1, FIRST_STALL)]
)
def test_a_jam_of_a_first_attempt_is_given_up_sooner(attempt, retries, share):
    adjust = plan(attempt=attempt, retries=retries, stall_timeout=5.0).adjust
    assert (adjust.stall_timeout, adjust.stall_at_bottom) == pytest.approx((5.0 * share, 10.0 * share))


@pytest.mark.parametrize("cell", [CELL, SQUARE.cell])
def test_a_weak_grip_searches_with_less_push_and_slower(cell):
    firm, weak = plan(cell).search, plan(cell, grip_share=WEAK).search
    bears = grip_of(cell.params(GRASP), WEAK).bears_over_plate(weak.tilt, weak.dip_threshold)
    assert weak.push_stiffness * weak.push_offset == pytest.approx(bears)
    assert weak.speed / firm.speed == pytest.approx(weak.push_stiffness / firm.push_stiffness)


def test_a_thin_peg_is_pushed_harder_and_falls_less():
    thin = load(sets=["peg.diameter=0.004", "hole.diameter=0.0041"]).cell
    search, stated = plan(thin, force=200.0).search, thin.params(SEARCH)
    push = search.push_stiffness * search.push_offset
    assert push == pytest.approx(stated.thin_push) != stated.push_stiffness * stated.push_offset
    assert search.dip_threshold == pytest.approx(stated.thin_dip * 0.004)
    assert search.fall == pytest.approx(stated.fall * 0.004 / stated.stated)


def test_a_round_peg_has_the_retries_of_its_recipe():
    round_peg = plan()
    assert (round_peg.retries, round_peg.steered, round_peg.corner) == (RETRIES, {}, None)


@pytest.mark.parametrize(("attempt", "has_failed"), [(0, False), (1, True), (4, True)])
def test_a_peg_is_turned_upright_more_slowly_after_a_failure(attempt, has_failed):
    insert = load().cell.plan(attempt).insert
    rate = insert.steady_rate if has_failed else 1.0
    assert (insert.turn_rate, insert.turn_run_up) == pytest.approx((rate, 0.4 / rate))


def test_a_peg_with_corners_has_the_retries_of_its_section():
    square, corner = plan(SQUARE.cell), SQUARE.cell.corner
    assert (square.retries, square.insert) == (corner.retries, None)
    assert square.steered == {f"corner.{name}.gains": getattr(corner, name).gains for name in ("insert", "adjust")}
    assert (square.search.tilt, square.search.lag) == (corner.tilt, corner.lag)


class Bench(ScriptedHand):
    """A peg that leans in the hole's mouth by default."""

    def run(self, skill, plane=None, attempt=0, **changes):
        """Insert or adjust it by the plan of an attempt, with these changes."""
        self.move()
        return skill(plan(self.rig.cell.config, attempt, **changes), self.ctx, plane)

    @property
    def pushes(self):
        """Stiffness along z of each setpoint, N/m."""
        return np.array([setpoint.stiffness[2] for setpoint in self.commanded])


@pytest.fixture
def bench(tmp_path):
    return Bench(Rig(load(sets=[LIGHT]), tmp_path), lambda time: hand(HOLE - 1e-3 * UP, 0.5))


@pytest.fixture
def square(tmp_path):
    return Bench(Rig(SQUARE, tmp_path), lambda time: corner_hand(HOLE, SQUARE.cell.corner.tilt))


@pytest.fixture(params=["bench", "square"])
def either(request):
    return request.getfixturevalue(request.param)


@pytest.mark.parametrize("attempt", [0, 1])
def test_an_insertion_counts_from_the_plate_that_was_felt(either, attempt):
    ended = either.run(insert, LOWER, attempt)
    assert (ended.reason, ended.elapsed) == (Reason.NOT_ALIGNED, 0.0)


@pytest.mark.parametrize("attempt", [0, 1])
def test_a_weak_grip_inserts_with_a_weaker_push(either, attempt):
    cell = either.rig.cell.config
    either.run(insert, attempt=attempt, grip_share=WEAK, inserting=0.05)
    bears = grip_of(cell.params(GRASP), WEAK).bears
    assert either.pushes.max() * cell.params(INSERT).push_offset < 1.001 * bears


def test_an_adjustment_follows_the_felt_plate_and_the_grip(bench):
    bench.way = lambda time: hand()
    bench.run(adjust, FELT, timeout=0.05, grip_share=WEAK)
    np.testing.assert_allclose(bench.commanded[0].axis, FELT.normal, atol=1e-9)
    assert bench.pushes[0] * CELL.params(ADJUST).push_offset < grip_of(CELL.params(GRASP), WEAK).bears


SETTLED = (
    (SQUARE.cell.corner.tilt - SQUARE.cell.corner.insert.tilt) / SQUARE.cell.corner.insert.raise_rate
    + SQUARE.cell.corner.insert.raise_stop / 2.0
    + SQUARE.cell.corner.insert.settle
)
"""Time at which a peg that leans over its corner is raised, and has settled, s."""


@pytest.mark.parametrize(("attempt", "later"), [(0, True), (1, False)])
def test_each_attempt_with_corners_sweeps_about_another_middle(square, attempt, later):
    """A hand that does not turn lags behind a far middle at once, behind a near one later."""
    given = SQUARE.cell.corner.insert
    square.way = lambda time: corner_hand(HOLE, SQUARE.cell.corner.tilt if time < 0.5 else given.tilt)
    ended = square.run(insert, attempt=attempt)
    assert ended.outcome is Outcome.SUCCESS
    sweeping = given.felt / given.turn_rate if later else 0.0
    assert ended.elapsed == pytest.approx(SETTLED + sweeping, abs=3 * PERIOD)


ENTERED = 0.1
"""Time at which a peg with corners has sunk between the walls, s."""


def entering(time):
    """Return the hand whose peg sinks between the walls, stands upright there, and turns about the vertical from then on."""
    corner = SQUARE.cell.corner
    if time < ENTERED - 1e-9:
        return corner_hand(HOLE, corner.insert.tilt)
    deep = 1.1 * corner.adjust.entered if time < 0.3 - 1e-9 else SQUARE.cell.hole.depth
    return corner_hand(HOLE - deep * UP, 0.0, yaw=0.2 * (time - ENTERED))


def test_a_peg_with_corners_is_seated_once_between_the_walls(square):
    square.way = entering
    square.rig.at(0.3, lambda: setattr(square.rig.switch, "state", SwitchState.CLOSED))
    ended = square.run(adjust)
    assert isinstance(ended, SpiralAdjustResult)
    assert (ended.outcome, ended.elapsed) == (Outcome.SUCCESS, pytest.approx(0.3, abs=1.1 * PERIOD))
    seating = [each for each in square.commanded if each.id == square.commanded[-1].id]
    last = square.seen[len(square.seen) - 2]
    np.testing.assert_allclose(seating[-1].roll, last.arm.tcp.rotation[:, 2], atol=1e-12)
    assert angle_between(seating[0].roll, seating[-1].roll) > 0.02


def test_a_peg_with_corners_outside_the_walls_is_not_seated(square):
    strays = 1.1 * SQUARE.cell.corner.adjust.strayed
    square.way = lambda time: corner_hand(HOLE + (strays * SIDE if time > 0.05 else 0.0), 0.12)
    ended = square.run(adjust)
    assert isinstance(ended, CornerAdjustResult)
    assert (ended.outcome, ended.reason) == (Outcome.FAILURE, Reason.NOT_SEATED)
    assert len({each.id for each in square.commanded}) == 1


def test_both_parts_of_an_adjustment_follow_the_felt_plate_and_grip(square):
    square.way = entering
    square.run(adjust, FELT, timeout=0.05, grip_share=WEAK)
    first, then = square.commanded[0], square.commanded[-1]
    seating = next(each for each in square.commanded if each.id == then.id)
    assert first.id != then.id
    assert angle_between(first.axis, square.seen[0].axis) < 1e-3
    np.testing.assert_allclose(seating.axis, FELT.normal, atol=1e-9)
    bears, entry = grip_of(SQUARE.cell.params(GRASP), WEAK).bears, SQUARE.cell.corner.adjust
    assert square.pushes[0] * entry.push_offset < bears
    assert square.pushes[-1] * SQUARE.cell.params(ADJUST).push_offset < bears
