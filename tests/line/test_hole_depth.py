"""A hole whose depth differs from the recipe's: within a millimetre the peg is seated."""

import pytest

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from skills.catalogue import CATALOGUE
from skills.contract import Outcome

BELIEVED = 0.02


@pytest.mark.parametrize("error", [-0.001, 0.001])
def test_a_peg_is_seated_in_a_hole_that_is_a_millimetre_deeper_or_less_deep_than_the_recipe_says(error):
    sets = ["reality.scale=0.0", "sim.pace=max", "sim.seed=5", "hole.area=[0.002,0.002]", f"hole.depth={BELIEVED}"]
    config = load(sets=sets).cell
    cell = assemble(config)
    assert cell.truth is not None
    with opened(cell):
        ctx = cell.context(5)
        true = ctx.job.hole.model_copy(update={"depth": BELIEVED + error})
        cell.clear()
        cell.restock(ctx.job.model_copy(update={"hole": true}), 5)
        records = CATALOGUE["insert_peg"].run(config.skill_set(), ctx)
        assert [record.result.outcome for record in records] == [Outcome.SUCCESS] * 5
        assert cell.truth().switch_closed
