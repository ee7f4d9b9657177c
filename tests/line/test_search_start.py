"""Where a search begins: beside where the hole may be, so that the plate is felt before the hole is."""

from dataclasses import replace

import pytest

from cell.config.load import load
from cell.devices.assembly import assemble, opened
from drivers.quantities import ImpedanceSetpoint
from skills.catalogue import GRASP, SEARCH
from skills.contract import Observation, Outcome
from skills.search import spray_search

PARTS = {
    "as shipped": (),
    "no margin": ("search.margin=[0.0, 0.0]",),
    "10 x 10 mm": ("hole.area=[0.01, 0.01]",),
    "16 mm": ("peg.diameter=0.016", "hole.diameter=0.0162"),
    "square": ("peg.shape=square", "hole.area=[0.01, 0.01]"),
}


@pytest.mark.parametrize("sets", PARTS.values(), ids=PARTS)
@pytest.mark.parametrize("seed", [101, 102])
def test_peg_comes_down_on_the_plate_even_where_the_hole_is_known_well_and_finds_it(
    seed: int, sets: tuple[str, ...]
) -> None:
    config = load(None, None, ["sim.pace=max", f"sim.seed={seed}", "hole.area=[0.001, 0.001]", *sets]).cell
    cell = assemble(config)
    assert cell.truth is not None
    touched: list[float] = []
    with opened(cell):
        ctx = cell.context(seed)
        GRASP.run(config.skill_set(), ctx)
        skills = config.skill_set()

        def watch(seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
            truth = cell.truth()  # type: ignore[misc]
            if ctx.stage == "spray_search" and seen.arm.wrench.force[2] > 3.0:
                touched.append(truth.hole[2] - truth.tip[2])

        ctx.callbacks = replace(ctx.callbacks, record=watch)
        found = SEARCH.run(skills, ctx)[-1].result
    assert found.outcome is Outcome.SUCCESS
    # The middle of the end of a peg that leans, its edge on the plate, is above the plate by more than half of its radius.
    assert touched[0] < -config.peg.part.inscribed / 4
    assert found.elapsed < 6.0
    assert isinstance(found, spray_search.SpraySearchResult)
