"""A peg that seems to be short of the bottom is pushed on until something bears it."""

import pytest

import cell.peg.success
from cell.config.load import load
from cell.lab.trials import run_trial
from skills.seating.decision import DOUBTED, MOST_SHALLOW
from tests.reality_files import reality_of


@pytest.mark.parametrize(("borne", "ending"), [(DOUBTED, "success"), (MOST_SHALLOW, "failure")])
def test_a_seated_peg_that_seems_a_millimetre_short_is_believed_because_the_bottom_bears_it(
    borne, ending, tmp_path, monkeypatch
):
    """TCP and peg are 1.3 mm elsewhere than stated, which the hand at 45 degrees and the upright one show by 1.1 mm apart."""
    path = reality_of(tmp_path, arm_tcp_place=-0.0013, peg_depth_in_hand=0.0013)
    monkeypatch.setattr(cell.peg.success, "DOUBTED", borne)
    row = run_trial(load(sets=[f'reality.file="{path}"', "hole.area=[0.01,0.01]"]).cell, 2)
    assert (row.outcome, row.reason) == (ending, "" if ending == "success" else "switch_disagrees")
    assert row.depth > 0.0199
