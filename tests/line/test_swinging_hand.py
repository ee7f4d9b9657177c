"""A hand that is still turning when the peg goes down the hole."""

import pytest

from cell.config.load import load
from cell.lab.trials import run_trial
from skills.catalogue import ADJUST
from skills.contract import Outcome


@pytest.mark.parametrize("seed", [115324, 115338])
def test_a_hand_that_swings_through_upright_does_not_strike_the_hole_with_a_deep_peg(seed):
    # Arms with heavy rotors and late scans, turned at 1 rad/s: let down as fast as an upright peg, these pegs
    # were 5 to 6 mm deep when the hand passed upright, and the walls stopped it with 89 and 69 N.
    careless = ["world=v1", "preset=fast", "reality.scale=2"]
    cell = load(sets=careless).cell
    gently, at_once = (run_trial(each, seed) for each in (cell, cell.with_params(ADJUST, swing_time=1e-6)))
    assert gently.outcome == Outcome.SUCCESS
    assert gently.peak_contact_force < 0.6 * at_once.peak_contact_force
