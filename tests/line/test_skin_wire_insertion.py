"""A whole insertion with the skin behind its wire: real driver, real bytes, an emulated board in the simulated hand."""

import pytest

from cell.config.load import load
from cell.lab.trials import run_trial

SEED = 4
STIFF = 'reality.without=["grip.shear_stiffness"]'
"""Pads that do not let the peg turn, which is not what these tests are about."""


def test_an_insertion_through_the_board_ends_as_with_the_plain_stand_in():
    """One seed of what `cell study wire` does with many."""
    plain, wired = (run_trial(load(sets=[f"skin.kind={name}", STIFF]).cell, SEED) for name in ("sim", "can"))
    assert (wired.outcome, wired.switch_closed) == (plain.outcome, plain.switch_closed) == ("success", True)
    assert wired.depth == pytest.approx(plain.depth, abs=1e-4)


@pytest.mark.parametrize("kind", ["can", "serial"])
def test_a_board_that_is_unplugged_on_the_way_ends_in_its_fault_and_no_success(kind):
    config = load(sets=[f"skin.kind={kind}", STIFF, "boards.skin.faults.unplugged=[[15.0, 1e6]]"]).cell
    row = run_trial(config, SEED)
    assert (row.outcome, row.reason, row.switch_closed) == ("failure", "skin_silent", False)
    assert row.sim_time < 16.0
