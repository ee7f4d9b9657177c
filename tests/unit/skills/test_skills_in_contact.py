"""Motion, gains and endings that all skills that push a peg into its hole share."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from cell.config.load import LoadedConfig, load
from drivers.errors import SwitchDisagreesError, SwitchUnknownError
from drivers.frames import UP, rotation_about
from drivers.quantities import SwitchState
from skills.catalogue import ADJUST, INSERT
from skills.contract import Outcome, Reason
from skills.corner import adjust as corner_adjust
from skills.corner import insert as corner_insert
from skills.insert import spiral_adjust, tactile_insert
from skills.motion import VALIDITY
from skills.search.surface import Plane
from tests.fakes import PERIOD, Rig
from tests.scripted import CELL, HOLE, LIGHT, SQUARE, corner_hand, hand
from tests.unit.skills.benches import SkillBench

ROUND, CORNER = load(sets=[LIGHT]), SQUARE.cell.corner


@dataclass(frozen=True)
class Kind:
    """A skill, and the lean at which its peg stands in the hole's mouth, rad."""

    skill: object
    params: object
    lean: float
    loaded: LoadedConfig = ROUND
    going_on: dict = field(default_factory=dict)
    """Parameters with which a peg at rest does not end it."""
    is_adjustment: bool = False
    """Whether it keeps the in-hand angle that it began with, and pushes with one stiffness."""

    def at(self, depth, theta=0.0):
        """Return the hand whose peg is so deep, m."""
        if self.loaded is SQUARE:
            return corner_hand(HOLE - depth * UP, self.lean, 0.3, theta=theta)
        return hand(HOLE - depth * UP, self.lean)


UNFELT = {"felt": 1.0, "sunk": 1.0, "strayed": 1.0}
KINDS = {
    "insert": Kind(tactile_insert.run, CELL.params(INSERT), 0.5),
    "adjust": Kind(spiral_adjust.run, CELL.params(ADJUST), 0.0, is_adjustment=True),
    "corner insert": Kind(corner_insert.run, CORNER.insert, 0.5, SQUARE, {**UNFELT, "push_back": 1.0}),
    "corner adjust": Kind(corner_adjust.run, CORNER.adjust, 0.12, SQUARE, is_adjustment=True),
}


@pytest.fixture(params=KINDS)
def kind(request):
    return KINDS[request.param]


@pytest.fixture
def bench(kind, tmp_path):
    return SkillBench(Rig(kind.loaded, tmp_path), kind.skill, kind.params, lambda time: kind.at(1e-3))


def test_a_run_is_one_motion_with_the_gains_of_its_recipe(kind, bench):
    bench.skin.theta, bench.way = 0.05, lambda time: kind.at(1e-3, 0.05)
    bench.turn(0.1, 0.15)
    integral = {} if kind.is_adjustment else {"integral_gain": 4.0, "integral_limit": 2.0}
    bench.run(timeout=0.35, **kind.going_on, **integral)
    gains, length = kind.params.gains, bench.ctx.length
    assert len({setpoint.id for setpoint in bench.commanded}) == 1
    assert len(bench.commanded) == 35
    for seen, setpoint in bench.scans():
        theta = bench.seen[0].peg.theta if kind.is_adjustment else seen.peg.theta
        assert (setpoint.in_hand.theta, setpoint.in_hand.length) == (theta, length)
        assert setpoint.valid_until == seen.stamp + VALIDITY
        stiffness = [gains.translation] * 2 + [gains.rotation] * 3
        np.testing.assert_array_equal(np.delete(setpoint.stiffness, 2), stiffness)
        push = getattr(kind.params, "push_damping_ratio", gains.damping_ratio)
        np.testing.assert_array_equal(setpoint.damping_ratio, np.where(np.arange(6) == 2, push, gains.damping_ratio))
        if isinstance(kind.params.push_stiffness, float):
            assert setpoint.stiffness[2] == kind.params.push_stiffness
        if integral:
            assert (setpoint.integral_gain, setpoint.integral_limit) == (4.0, 2.0)


def test_two_runs_are_two_motions_of_their_own(bench):
    bench.run(timeout=0.05)
    bench.run(timeout=0.05)
    assert list(dict.fromkeys(setpoint.id for setpoint in bench.commanded)) == [1, 2]


@pytest.mark.parametrize("kind", ["adjust", "corner insert", "corner adjust"], indirect=True)
def test_progress_is_the_share_of_the_timeout(kind, bench):
    bench.run(timeout=0.3, **kind.going_on)
    assert bench.progress == pytest.approx([seen.running / 0.3 for seen in bench.seen])


def test_a_switch_that_closes_at_the_holes_depth_ends_it_well(kind, bench):
    bench.way = lambda time: kind.at(CELL.hole.depth)
    bench.rig.at(0.1, lambda: setattr(bench.rig.switch, "state", SwitchState.CLOSED))
    ended = bench.run()
    assert (ended.outcome, ended.reason) == (Outcome.SUCCESS, Reason.NONE)
    assert ended.elapsed == pytest.approx(0.1, abs=1.1 * PERIOD)
    if kind.is_adjustment:
        assert ended.depth == pytest.approx(CELL.hole.depth)
    else:
        assert ended.phi == pytest.approx(kind.lean)


@pytest.mark.parametrize(
    ("state", "error"), [(SwitchState.CLOSED, SwitchDisagreesError), (SwitchState.UNKNOWN, SwitchUnknownError)]
)
def test_a_switch_closed_too_early_or_unknown_is_a_fault(bench, state, error):
    bench.rig.switch.state = state
    with pytest.raises(error, match=r"^switch"):
        bench.run()


def test_a_peg_that_the_hand_loses_ends_it_at_once(kind, bench):
    assert bench.lost_in(lambda: bench.run(**kind.going_on)) is Reason.LOST_GRASP
    assert len(bench.commanded) == pytest.approx(0.1 / PERIOD, abs=1)


@pytest.mark.parametrize(
    ("kind", "still"),
    [("insert", {"turn_rate": 1e-6, "turn_run_up": 0.0}), ("corner insert", {"raise_rate": 1e-9, **UNFELT})],
    indirect=["kind"],
)
@pytest.mark.parametrize("rate", [4.0, 1e3])
def test_the_hand_turns_after_the_peg_at_the_follow_rate(bench, still, rate):
    """The peg's axis stays as it was, for the hand is where the test puts it."""
    bench.turn(0.1, 0.2)
    bench.run(follow_rate=rate, **still)
    start, closing = bench.seen[0].axis, bench.seen[0].arm.tcp.rotation[:, 2]
    behind = 0.0
    for before, (seen, setpoint) in zip([bench.seen[0], *bench.seen], bench.scans(), strict=False):
        behind = (behind + seen.peg.theta - before.peg.theta) * max(1.0 - rate * PERIOD, 0.0)
        np.testing.assert_allclose(setpoint.axis, rotation_about(closing, behind) @ start, atol=2e-6)
    assert seen.peg.theta == pytest.approx(0.2)
    assert (behind > 0.01) == (rate < 10.0)


@pytest.mark.parametrize(("above", "goes_on"), [(-1e-5, True), (1e-5, False)])
@pytest.mark.parametrize("raises", [0.0, 2e-3])
@pytest.mark.parametrize(("kind", "reach"), [("insert", "reach"), ("corner insert", "widest")], indirect=["kind"])
def test_a_peg_above_the_lost_height_is_out_of_the_hole(kind, bench, reach, above, goes_on, raises):
    rim = getattr(kind.loaded.cell.peg.part, reach) * math.sin(kind.lean)
    bench.way = lambda time: kind.at(-(kind.params.lost_height + rim + above + raises))
    ended = bench.run(Plane(HOLE + raises * UP, UP) if raises else None, timeout=0.2)
    assert (ended.outcome, ended.reason) == (Outcome.FAILURE, Reason.NOT_ALIGNED)
    assert (bool(bench.commanded), ended.elapsed) == (goes_on, pytest.approx(0.2 if goes_on else 0.0))
    assert ended.phi == pytest.approx(kind.lean)
