"""A peg that did not seat: how long it is tried for, and how it leaves the hole before another search."""

import numpy as np

from cell.assembly import assemble, opened
from cell.config import load
from skills import catalogue, spiral_adjust, spray_search, tactile_insert
from skills.contract import Outcome, Reason


def test_peg_that_stands_in_the_hole_is_pulled_out_before_it_is_led_aside():
    """Half-way down, and gripped as a search left it: the tip leaves along the bore, with less than the force limit."""
    config = load(None, None, ["sim.pace=max", "sim.seed=105"]).cell
    skills = config.skill_set()
    cell = assemble(config)
    assert cell.truth is not None
    deep, outside = [], []
    with opened(cell):
        ctx = cell.context(105)
        catalogue.grasp(skills, ctx)
        seated = catalogue.find_and_seat(skills, ctx)[-1].result
        assert seated.outcome is Outcome.SUCCESS

        def watch(seen, setpoint):
            truth = cell.truth()
            aside = float(np.hypot(*(np.array(truth.tip) - np.array(truth.hole))[:2]))
            (deep if truth.tip[2] < truth.hole[2] - 1e-3 else outside).append(aside)

        ctx.record = watch
        again = spray_search.run(config.search, ctx)
        peak = cell.truth().peak_contact_force
    assert again.outcome is Outcome.SUCCESS
    assert len(deep) > 5
    assert max(deep) < 1e-3
    assert max(outside) > 5e-3
    assert peak < 30.0


def test_peg_that_goes_no_deeper_is_given_up_after_the_patience_and_not_after_the_timeout():
    config = load(None, None, ["sim.pace=max", "sim.seed=104", "search.timeout=1"]).cell
    cell = assemble(config)
    with opened(cell):
        ctx = cell.context(104)
        catalogue.grasp(config.skill_set(), ctx)
        assert spray_search.run(config.search, ctx).reason is Reason.NO_HOLE
        tactile_insert.run(config.insert, ctx)
        ended = spiral_adjust.run(config.adjust, ctx)
    assert ended.outcome is Outcome.FAILURE
    assert ended.reason is Reason.NOT_SEATED
    assert config.adjust.patience <= ended.elapsed < config.adjust.timeout / 2
