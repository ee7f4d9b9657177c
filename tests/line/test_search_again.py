"""A peg that did not seat: how long it is tried for, and how it leaves the hole before another search."""

import math
from dataclasses import replace

import numpy as np

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from cell.lab.trials import run_trial
from skills.catalogue import GRASP, find_and_seat
from skills.contract import Outcome, Reason
from skills.insert import spiral_adjust, tactile_insert
from skills.search import spray_search
from skills.search.surface import Plane
from tests.reality_files import reality_of


def test_peg_that_stands_in_the_hole_is_pulled_out_before_it_is_led_aside():
    """From the bottom, gripped as the adjustment left it: the tip leaves along the bore, well below the force limit."""
    config = load(None, None, ["sim.pace=max", "sim.seed=105"]).cell
    skills = config.skill_set()
    cell = assemble(config)
    assert cell.truth is not None
    deep, outside = [], []
    with opened(cell):
        ctx = cell.context(105)
        GRASP.run(skills, ctx)
        seated = find_and_seat(skills, ctx)[-1].result
        assert seated.outcome is Outcome.SUCCESS

        def watch(seen, setpoint):
            truth = cell.truth()
            aside = float(np.hypot(*(np.array(truth.tip) - np.array(truth.hole))[:2]))
            (deep if truth.tip[2] < truth.hole[2] - 1e-3 else outside).append(aside)

        ctx.callbacks = replace(ctx.callbacks, record=watch)
        again = spray_search.run(config.search, ctx)
        peak = cell.truth().peak_contact_force
    assert again.outcome is Outcome.SUCCESS
    assert len(deep) > 5
    assert max(deep) < 1e-3
    assert max(outside) > 5e-3
    assert peak < 0.75 * config.limits.force


def test_peg_that_goes_no_deeper_is_given_up_after_the_patience_and_not_after_the_timeout():
    config = load(None, None, ["sim.pace=max", "sim.seed=104", "search.timeout=1"]).cell
    cell = assemble(config)
    with opened(cell):
        ctx = cell.context(104)
        GRASP.run(config.skill_set(), ctx)
        assert spray_search.run(config.search, ctx).reason is Reason.NO_HOLE
        tactile_insert.run(config.insert, ctx)
        ended = spiral_adjust.run(config.adjust, ctx)
    assert ended.outcome is Outcome.FAILURE
    assert ended.reason is Reason.NOT_SEATED
    assert config.adjust.stall_timeout <= ended.elapsed < config.adjust.timeout / 2


def test_peg_that_jams_along_a_wrongly_felt_normal_is_freed_where_it_rests():
    """The hole stands upright, the plate was felt 3 degrees off: along that the peg fits 2 mm deep and no further."""
    config = load(None, None, ["sim.pace=max", "sim.seed=105", "grip.friction=0.6"]).cell
    cell = assemble(config)
    with opened(cell):
        ctx = cell.context(105)
        GRASP.run(config.skill_set(), ctx)
        found = spray_search.run(config.search, ctx)
        felt = np.array([math.sin(math.radians(3.0)), 0.0, math.cos(math.radians(3.0))])
        wrong = Plane(found.plane.point, felt)
        tactile_insert.run(config.insert, ctx, wrong)
        ended = spiral_adjust.run(config.adjust, ctx, wrong)
    assert ended.outcome is Outcome.SUCCESS


def test_peg_whose_depth_is_misjudged_by_what_stands_elsewhere_is_adjusted_when_it_was_found_again(tmp_path):
    """A plate 3.5 mm lower than stated is taken for a shorter peg, which an upright hand shows 1.4 mm less deep than it is."""
    path = reality_of(tmp_path, place_plate_height=-0.0035)
    row = run_trial(load(sets=[f'reality.file="{path}"', "hole.area=[0.01,0.01]"]).cell, 1)
    assert (row.outcome, row.retries) == (Outcome.SUCCESS, 1)
    assert row.depth > 0.0199


def test_a_hole_at_the_border_that_the_first_cover_passes_by_is_found_by_the_second():
    """0.2 mm inside the border across the lanes of `fast`, where the first lane lies 2.7 mm from it; a cover takes 6 s."""
    row = run_trial(load(sets=["preset=fast"]).cell, 116353)
    assert row.outcome == "success"
    assert 5.0 < row.search_time < 10.0
