"""A peg that seems to be short of the bottom is pushed on until something bears it."""

from cell.config import load
from cell.lab.trials import run_trial
from skills.contract import Outcome


def test_a_seated_peg_that_seems_a_millimetre_short_is_believed_once_the_bottom_bears_it():
    """The search of this cell, whose hand lies at 45 degrees, takes the plate to be 1.0 mm lower than the upright peg shows."""
    row = run_trial(load().cell, 91369)
    assert row.outcome == Outcome.SUCCESS
