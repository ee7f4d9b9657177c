"""The simulated cell and its peg: what is dropped lies there, starts are refused, `recover` frees what it can, nothing is torn out."""

import numpy as np
import pytest

from cell.run.states import State
from drivers.quantities import SwitchState
from plc_bridge.protocol.messages import Control, PartPlace, Refusal, Result
from sim.world.situation import PegSituation
from skills.contract import Reason
from tests.fakes import FakeSwitch
from tests.simulated_line import GRASP, INSERT, RECOVER, RELEASE, line

SEARCH_STAGE = 2


def test_a_dropped_peg_lies_where_it_fell_until_a_person_takes_it_away(tmp_path):
    with line(tmp_path) as made:
        made.when(lambda report: report.stage == SEARCH_STAGE and report.progress > 0, made.plc.stop)
        assert made.command(INSERT).part == PartPlace.IN_HAND
        assert made.command(Control.RESET).state == State.IDLE
        report = made.command(RELEASE)
        assert (report.result, report.reason, report.part) == (Result.FAILURE, Reason.NOT_SEATED, PartPlace.ON_PLATE)
        lies_at = made.world.peg_pose().position
        refused = made.command(INSERT)
        assert (refused.refusal, refused.state) == (Refusal.PART_UNRESOLVED, State.COMPLETE)
        report = made.command(RECOVER)
        assert (report.result, report.reason, report.part) == (Result.FAILURE, Reason.PART_LEFT, PartPlace.ON_PLATE)
        np.testing.assert_allclose(made.world.peg_pose().position, lies_at, atol=0.02)
        assert made.world.peg is PegSituation.FREE
        assert made.command(Control.CLEARED).part == PartPlace.RACK
        assert made.world.peg is PegSituation.GONE
        assert made.command(GRASP).result == Result.SUCCESS


def test_a_start_recovers_first_where_the_config_says_so(tmp_path):
    with line(tmp_path, "recover.first=true") as made:
        made.command(GRASP)
        report = made.command(GRASP)
        assert (report.result, report.part) == (Result.SUCCESS, PartPlace.IN_HAND)
        times = dict(
            zip(("grasp", "search", "insert", "adjust", "release", "recover"), report.stage_times, strict=False)
        )
        assert times["recover"] > 1.0


@pytest.mark.parametrize(
    ("state", "refusal"), [(SwitchState.CLOSED, Refusal.HOLE_OCCUPIED), (SwitchState.UNKNOWN, Refusal.SWITCH_UNKNOWN)]
)
def test_a_switch_that_is_closed_or_unknown_refuses_a_start_before_anything_moves(tmp_path, state, refusal):
    with line(tmp_path, switch=lambda cell: FakeSwitch(state)) as made:
        before = made.world.q
        report = made.command(INSERT)
        assert (report.refusal, report.result) == (refusal, Result.REFUSED)
        np.testing.assert_allclose(made.world.q, before, atol=1e-3)
