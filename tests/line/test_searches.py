"""Searches of a whole simulated cell: their beginning, a hold, and repetition after a peg that did not seat."""

import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.quantities import ImpedanceSetpoint
from skills.catalogue import GRASP, SEARCH, find_and_seat
from skills.contract import Observation, Outcome, Reason, Request
from skills.insert import spiral_adjust, tactile_insert
from skills.search import spray_search
from skills.search.surface import Plane
from tests.simulated_line import at_work

PARTS = {
    "as shipped": (),
    "no margin": ("search.margin=0.0",),
    "10 x 10 mm": ("hole.area=[0.01, 0.01]",),
    "16 mm": ("peg.diameter=0.016", "hole.diameter=0.0162"),
    "square": ("peg.shape=square", "hole.area=[0.01, 0.01]"),
}


@pytest.mark.parametrize("part", PARTS)
def test_peg_comes_down_beside_a_well_known_hole_and_finds_it(part: str) -> None:
    touched: list[float] = []
    with at_work(102, "hole.area=[0.001, 0.001]", *PARTS[part]) as (cell, ctx):
        assert cell.truth is not None
        skills = cell.config.skill_set()
        GRASP.run(skills, ctx)

        def watch(seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
            truth = cell.truth()  # type: ignore[misc]
            if ctx.stage == "spray_search" and seen.arm.wrench.force[2] > 3.0:
                touched.append(truth.hole[2] - truth.tip[2])

        ctx.callbacks = replace(ctx.callbacks, record=watch)
        found = SEARCH.run(skills, ctx)[-1].result
    assert found.outcome is Outcome.SUCCESS
    # The middle of the end of a peg that leans, its edge on the plate, is above the plate by more than half of its radius.
    assert touched[0] < -cell.config.peg.part.inscribed / 4
    assert found.elapsed < 6.0


RUNNING, HELD, RESUMED = 0.3, 1.0, 1.0
"""s."""


def test_setpoint_of_a_held_search_goes_on_without_a_step() -> None:
    """A plate without a hole and the smallest dip threshold: most of the time the search probes."""
    sets = ("reality.scale=1.0", "sim.plate.present=false", "search.timeout=6", "search.dip_threshold=2e-5")
    steps: list[float] = []
    with at_work(105, *sets) as (cell, ctx):
        GRASP.run(cell.config.skill_set(), ctx)
        began, cycle = cell.clock.now(), RUNNING + HELD + RESUMED
        last: list[ImpedanceSetpoint] = []

        def ask() -> Request:
            since = (cell.clock.now() - began) % cycle
            if since < RUNNING:
                return Request.RUN
            return Request.HOLD if since < RUNNING + HELD else Request.RESUME

        def watch(seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
            if setpoint is not None and setpoint.in_hand is not None:
                if last and last[-1].id == setpoint.id:
                    steps.append(math.dist(last[-1].tip[:2], setpoint.tip[:2]))
                last[:] = [setpoint]

        ctx.callbacks = replace(ctx.callbacks, poll=ask, record=watch)
        ended = spray_search.run(cell.config.search, ctx)
    assert ended.reason is Reason.NO_HOLE
    assert ended.rests >= 2
    assert max(steps) < 5e-3


def test_a_peg_in_the_hole_is_pulled_out_before_it_moves_aside():
    """From the bottom, gripped as the adjustment left it: the tip leaves along the bore, well below the force limit."""
    deep, outside = [], []
    with at_work(105) as (cell, ctx):
        skills = cell.config.skill_set()
        GRASP.run(skills, ctx)
        seated = find_and_seat(skills, ctx)[-1].result
        assert seated.outcome is Outcome.SUCCESS

        def watch(seen, setpoint):
            truth = cell.truth()
            aside = float(np.hypot(*(np.array(truth.tip) - np.array(truth.hole))[:2]))
            (deep if truth.tip[2] < truth.hole[2] - 1e-3 else outside).append(aside)

        ctx.callbacks = replace(ctx.callbacks, record=watch)
        again = spray_search.run(cell.config.search, ctx)
        peak = cell.truth().peak_contact_force
    assert again.outcome is Outcome.SUCCESS
    assert len(deep) > 5
    assert max(deep) < 1e-3
    assert max(outside) > 5e-3
    assert peak < 0.75 * cell.config.limits.force


def test_peg_that_goes_no_deeper_is_given_up_before_the_timeout():
    with at_work(104, "search.timeout=1") as (cell, ctx):
        config = cell.config
        GRASP.run(config.skill_set(), ctx)
        assert spray_search.run(config.search, ctx).reason is Reason.NO_HOLE
        tactile_insert.run(config.insert, ctx)
        ended = spiral_adjust.run(config.adjust, ctx)
    assert ended.outcome is Outcome.FAILURE
    assert ended.reason is Reason.NOT_SEATED
    assert config.adjust.stall_timeout <= ended.elapsed < config.adjust.timeout / 2


def test_a_peg_jammed_by_a_wrong_normal_is_freed():
    """The hole stands upright, the plate was felt 3 degrees off: along that the peg fits 2 mm deep and no further."""
    with at_work(105, "grip.friction=0.6") as (cell, ctx):
        config = cell.config
        GRASP.run(config.skill_set(), ctx)
        found = spray_search.run(config.search, ctx)
        felt = np.array([math.sin(math.radians(3.0)), 0.0, math.cos(math.radians(3.0))])
        wrong = Plane(found.plane.point, felt)
        tactile_insert.run(config.insert, ctx, wrong)
        ended = spiral_adjust.run(config.adjust, ctx, wrong)
    assert ended.outcome is Outcome.SUCCESS
