"""Whole insertions, and those whose hand does not open or whose peg does not come out: none of these is called a success."""

import math

import pytest

from cell.run.states import State
from plc_bridge.protocol.messages import Control, PartPlace, Refusal, Result
from skills.contract import Reason
from tests.simulated_line import INSERT, RECOVER, line

ADJUST_STAGE = 4


class StuckHand:
    """A hand that opens as long as it is empty, and never lets go of a peg."""

    def __init__(self, cell):
        self._hand = cell.gripper
        self.is_stuck = True

    def open(self): ...

    def close(self): ...

    def grip(self, force):
        self._hand.grip(force)

    def release(self, width):
        if not (self.is_stuck and self._hand.read().is_gripping):
            self._hand.release(width)

    def read(self):
        return self._hand.read()


def test_an_insertion_tells_every_bus_where_the_peg_is_and_the_next_one_finds_a_new_workpiece(tmp_path):
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


def test_a_hand_that_does_not_open_is_never_drawn_away_from_the_seated_peg(tmp_path):
    with line(tmp_path, gripper=StuckHand) as made:
        report = made.command(INSERT)
        assert (report.result, report.reason, report.part) == (Result.FAILURE, Reason.STILL_HELD, PartPlace.SEATED)
        report = made.command(RECOVER)
        assert (report.result, report.reason, report.part) == (Result.FAILURE, Reason.STILL_HELD, PartPlace.SEATED)
        truth = made.world.truth()
        assert truth.switch_closed
        assert report.peak_force < 0.75 * made.cell.config.limits.force
        made.cell.gripper.is_stuck = False
        report = made.command(RECOVER)
        assert (report.result, report.part) == (Result.SUCCESS, PartPlace.SEATED)
        assert made.world.truth().switch_closed


def stopped_in_the_hole(made, depth):
    """Stop an insertion while the peg is so deep in the hole, m, and reset."""
    made.when(lambda report: report.stage == ADJUST_STAGE and made.world.truth().depth > depth, made.plc.stop)
    report = made.command(INSERT)
    assert (report.state, report.part) == (State.STOPPED, PartPlace.IN_HOLE)
    assert made.command(Control.RESET).state == State.IDLE


def test_a_held_peg_in_the_hole_is_pulled_out_and_binned(tmp_path):
    with line(tmp_path) as made:
        stopped_in_the_hole(made, 0.008)
        assert made.command(INSERT).refusal == Refusal.PART_UNRESOLVED
        report = made.command(RECOVER)
        assert (report.result, report.part) == (Result.SUCCESS, PartPlace.BIN)
        assert report.peak_force < made.cell.config.limits.force


def test_a_peg_that_does_not_come_out_is_no_success_and_told_as_what_it_is(tmp_path):
    with line(tmp_path) as made:
        stopped_in_the_hole(made, 0.008)
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
