"""The simulated cell and its pegs: their places after good and bad runs, `recover`, and a fixture that is learned."""

import math

import numpy as np
import pytest

from cell.run.learning import read_learned
from cell.run.states import State
from plc_bridge.protocol.messages import Control, PartPlace, Refusal, Result
from sim.world.situation import PegSituation
from skills.catalogue import CATALOGUE
from skills.contract import Reason
from tests.simulated_line import GRASP, INSERT, RECOVER, RELEASE, Line, line


class StuckHand:
    """A hand that opens while it is empty, and never releases a peg."""

    def __init__(self, cell):
        self._hand = cell.gripper
        self.is_stuck = True

    def __getattr__(self, name):
        return getattr(self._hand, name)

    def release(self, width):
        if not (self.is_stuck and self.read().is_gripping):
            self._hand.release(width)


def test_an_insertion_reports_the_peg_and_the_next_finds_a_new_workpiece(tmp_path):
    with line(tmp_path) as made:
        report = made.command(INSERT)
        truth = made.world.truth()
        assert (report.result, report.part) == (Result.SUCCESS, PartPlace.SEATED)
        assert report.part_depth == pytest.approx(made.cell.config.hole.depth, abs=2e-3)
        assert math.dist(report.hole, truth.hole[:2]) < 1e-3
        assert 0.0 < report.peak_force < made.cell.config.limits.force
        made.plc.acknowledge()
        made.scan(3)
        assert made.command(INSERT).part == PartPlace.SEATED
        assert made.world.truth().hole[:2] != truth.hole[:2]


def test_a_closed_hand_is_never_drawn_away_from_a_seated_peg(tmp_path):
    with line(tmp_path, gripper=StuckHand) as made:
        for code in (INSERT, RECOVER):
            report = made.command(code)
            assert (report.result, report.reason, report.part) == (Result.FAILURE, Reason.STILL_HELD, PartPlace.SEATED)
        assert made.world.truth().switch_closed
        assert report.peak_force < 0.75 * made.cell.config.limits.force
        made.cell.gripper.is_stuck = False
        report = made.command(RECOVER)
        assert (report.result, report.part) == (Result.SUCCESS, PartPlace.SEATED)
        assert made.world.truth().switch_closed


def stopped(made, is_due):
    """Stop an insertion as soon as a report is so, reset, and return the place of the peg."""
    made.when(is_due, made.plc.stop)
    report = made.command(INSERT)
    assert report.state == State.STOPPED
    assert made.command(Control.RESET).state == State.IDLE
    return report.part


def stopped_in_the_hole(made):
    """Stop an insertion while the peg is 8 mm deep in the hole, and reset."""
    adjusting = CATALOGUE.stage_number("spiral_adjust")
    is_deep = lambda report: report.stage == adjusting and made.world.truth().depth > 0.008  # noqa: E731
    assert stopped(made, is_deep) == PartPlace.IN_HOLE


def test_a_held_peg_in_the_hole_is_pulled_out_and_binned(tmp_path):
    with line(tmp_path) as made:
        stopped_in_the_hole(made)
        assert made.command(INSERT).refusal == Refusal.PART_UNRESOLVED
        report = made.command(RECOVER)
        assert (report.result, report.part) == (Result.SUCCESS, PartPlace.BIN)
        assert report.peak_force < made.cell.config.limits.force


def test_a_peg_that_does_not_come_out_is_no_success(tmp_path):
    with line(tmp_path) as made:
        stopped_in_the_hole(made)
        running = made.world.running
        running.data.xfrc_applied[running.peg_body, 2] -= 80.0  # what holds it down, N
        report = made.command(RECOVER)
        # The hand lets go of it, or it slips through the pads before the pull has reached its bound.
        assert report.result == Result.FAILURE
        assert report.reason in (Reason.JAMMED, Reason.PART_LEFT)
        # Once let go, it is drawn in; one that slipped when it was out falls beside the hole.
        in_hole = made.world.truth().is_in_hole
        places = (PartPlace.IN_HOLE, PartPlace.SEATED) if in_hole else (PartPlace.ON_PLATE,)
        assert report.part in (*places, PartPlace.UNKNOWN)
        assert not made.cell.gripper.read().is_gripping


def test_a_dropped_peg_lies_until_a_person_takes_it_away(tmp_path):
    with line(tmp_path) as made:
        searching = CATALOGUE.stage_number("spray_search")
        assert stopped(made, lambda report: report.stage == searching and report.progress > 0) == PartPlace.IN_HAND
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
        assert report.stage_times[CATALOGUE.stage_number("recover") - 1] > 1.0


FIXTURE = ("sim.fixture={deviation=0.0005}", "hole.area=[0.06, 0.06]")
QUICK = 1.3
"""Longest search of a cell that has learnt the place of the hole, s."""


def searched(made: Line) -> float:
    """Return the time of the search for a hole that is then found, s."""
    report = made.command(INSERT)
    assert report.result == Result.SUCCESS
    assert math.dist(report.hole, made.world.truth().hole[:2]) < 1e-3
    return report.stage_times[CATALOGUE.stage_number("spray_search") - 1]


def test_the_third_part_of_a_fixture_is_found_at_once_after_restart(tmp_path):
    with line(tmp_path, *FIXTURE, seed=42001) as made:
        assert searched(made) > QUICK
        searched(made)
    with line(tmp_path, *FIXTURE, seed=42001) as made:
        made.command(Control.CLEARED)
        assert searched(made) < QUICK
        assert made.command(Control.FORGET, 7).refusal == Refusal.UNKNOWN_RECIPE
        assert made.command(Control.FORGET).refusal == Refusal.NONE
    assert read_learned(tmp_path).places == {}
