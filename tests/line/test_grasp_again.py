"""The cell goes on serving: the hand comes to the rack from where it let the last peg go, not from home."""

import math

import pytest

from cell.assembly import assemble, opened
from cell.config import load
from skills import catalogue
from skills.contract import Outcome


@pytest.mark.parametrize(("seed", "friction"), [(525, 0.25), (253, 0.6)])
def test_next_peg_is_held_where_the_cell_believes(seed, friction):
    """Joint friction holds a hand that comes from elsewhere aslant; a peg gripped so jams in its slot and is drawn through the pads."""
    config = load(None, None, ["sim.pace=max", f"sim.seed={seed}", f"contact.friction={friction}"]).cell
    skills = config.skill_set()
    cell = assemble(config)
    with opened(cell):
        ctx = cell.context(seed)
        for served in range(3):
            ctx.job = config.job(slot=served)
            cell.restock(ctx.job, seed + served)
            records = catalogue.grasp(skills, ctx)
            assert records[-1].result.outcome is Outcome.SUCCESS
            # The skin sees the angle, and nothing the length.
            truth, seen = cell.truth(), ctx.observe()
            along = (seen.tip - truth.tip) @ seen.axis
            assert abs(along) < 0.5e-3
            assert math.degrees(abs(seen.peg.theta - truth.theta)) < 5.0
            catalogue.find_and_seat(skills, ctx)
            catalogue.release(skills, ctx)
