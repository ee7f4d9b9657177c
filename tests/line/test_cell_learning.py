"""A served cell gets quicker with every part of a fixture, keeps that over a restart, and forgets it on command."""

import math

from cell.run.learning import read_learned
from plc_bridge.protocol.messages import Control, Refusal, Result
from skills.catalogue import CATALOGUE
from tests.simulated_line import INSERT, Line, line

FIXTURE = ("sim.fixture={deviation=0.0005}", "hole.area=[0.06, 0.06]")
QUICK = 1.3
"""Longest search of a cell that has learnt the place of the hole, s."""


def searched(made: Line) -> float:
    """Return the time of the search for a hole that is then found, s."""
    report = made.command(INSERT)
    assert report.result == Result.SUCCESS
    assert math.dist(report.hole, made.world.truth().hole[:2]) < 1e-3
    return report.stage_times[CATALOGUE.stage_number("spray_search") - 1]


def test_the_third_part_of_a_fixture_is_found_at_once_by_a_cell_that_was_restarted(tmp_path):
    with line(tmp_path, *FIXTURE, seed=42001) as made:
        assert searched(made) > QUICK
        searched(made)
    with line(tmp_path, *FIXTURE, seed=42001) as made:
        made.command(Control.CLEARED)
        assert searched(made) < QUICK
        assert made.command(Control.FORGET, 7).refusal == Refusal.UNKNOWN_RECIPE
        assert made.command(Control.FORGET).refusal == Refusal.NONE
    assert read_learned(tmp_path).places == {}
