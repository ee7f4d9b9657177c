"""A whole insertion with the skin behind its wire: real driver, real bytes, an emulated board in the simulated hand."""

from contextlib import suppress

import pytest

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from cell.lab.trials import run_trial
from drivers.errors import SkinSilentError
from drivers.quantities import SwitchState
from skills.catalogue import insert_peg
from skills.contract import Outcome

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


def test_the_next_insertion_succeeds_once_the_board_is_back():
    keys = [
        "skin.kind=serial",
        STIFF,
        "boards.skin.faults.unplugged=[[15.0, 16.0]]",
        "sim.pace=max",
        f"sim.seed={SEED}",
    ]
    config = load(sets=keys).cell
    with opened(assemble(config)) as cell:
        ctx = cell.context(SEED)
        with pytest.raises(SkinSilentError):
            insert_peg(config.skill_set(), ctx)
        assert cell.switch.read() is SwitchState.OPEN
        cell.arm.halt()
        while cell.clock.now() < 18.5:
            cell.clock.wait_until(cell.clock.now() + 0.01)
            with suppress(SkinSilentError):
                cell.skin.read()
        cell.clear()
        cell.restock(config.job(), SEED)
        records = insert_peg(config.skill_set(), cell.context(SEED))
        assert records[-1].result.outcome is Outcome.SUCCESS
