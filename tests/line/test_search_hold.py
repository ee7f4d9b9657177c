"""A search that is held: what it was doing goes on from where it was."""

import math
from dataclasses import replace

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from drivers.quantities import ImpedanceSetpoint
from skills.catalogue import GRASP
from skills.contract import Observation, Reason, Request
from skills.search import spray_search

RUNNING, HELD, RESUMED = 0.3, 1.0, 1.0
"""s."""


def test_setpoint_of_a_search_that_was_held_anywhere_goes_on_without_a_step() -> None:
    """A plate without a hole and the smallest dip threshold: most of the time the search probes."""
    sets = ["sim.pace=max", "reality.scale=1.0", "sim.seed=105", "sim.plate.present=false", "search.timeout=10"]
    sets += ["search.dip_threshold=2e-5"]
    config = load(None, None, sets).cell
    cell = assemble(config)
    steps: list[float] = []
    with opened(cell):
        ctx = cell.context(105)
        GRASP.run(config.skill_set(), ctx)
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
        ended = spray_search.run(config.search, ctx)
    assert ended.reason is Reason.NO_HOLE
    assert ended.rests >= 2
    assert max(steps) < 5e-3
