"""The ladder of models in its smallest form: everything is measured, marked and drawn, and nothing is dropped."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from cell.config.cell_config import CellConfig
from cell.config.load import load
from cell.lab.contact import charts, tables
from cell.lab.contact import measure as contact
from cell.lab.contact.boundaries import boundary_bouncing, boundary_bound
from cell.lab.contact.ladder import SHIPPED, Plan, Rung, model, on_trial, plan
from cell.lab.contact.measure import Findings, TrialsRow
from cell.lab.contact.needs import end_alike, needed
from drivers.part.rectangular import Rectangular
from drivers.part.round import Round
from sim import hand_rig

SHIPPED_STEP = 5e-4
EXACT = Rung(SHIPPED, "closed form", model(), SHIPPED_STEP)
SEAMS = Rung(
    "16 boxes, native, 1 ms", "ring of boxes, native CCD", model(facets=16, hole="boxes", native_ccd=True), 1e-3
)
EXPLODES = Rung("far too stiff", "closed form", model(stiffness=1e9), 5e-4)
IMPOSSIBLE = Rung("no time step", "closed form", model(), 0.0)
SMALL = Plan((EXACT, SEAMS, EXPLODES, IMPOSSIBLE), (0.3,), (2.5e-4, 1e-3), (1e5, 1e6, 1e8), 0, 0, 1)


@pytest.fixture(scope="module")
def config() -> CellConfig:
    return load(sets=('sim.pace="max"',)).cell


@pytest.fixture(scope="module")
def found(config: CellConfig) -> Findings:
    return contact.run(config, SMALL, 1)


def verdicts(found: Findings) -> dict[str, str]:
    return {row.name: contact.verdict(row) for row in found.rungs}


def test_the_shipped_model_is_good(found):
    row = found.rungs[0]
    assert contact.verdict(row) == "good"
    assert row.error < 0.003
    assert row.penetration < 1e-6


def test_models_that_cannot_work_are_marked_and_kept(found):
    told = verdicts(found)
    assert list(told) == [rung.name for rung in SMALL.rungs]
    assert "void" in told[SEAMS.name]
    assert "does not rest" in told[EXPLODES.name]
    assert "Error" in told[IMPOSSIBLE.name]


@pytest.mark.parametrize("sides", [(0.008, 0.008), (0.008, 0.012)])
def test_the_shipped_model_is_good_for_a_peg_with_corners_too(sides):
    peg = Rectangular(*sides)
    row = contact.measure_rung(EXACT, (0.3, 1.7), peg, peg.grown(5e-5))
    assert contact.verdict(row) == "good", row
    assert row.penetration < 1e-6


def test_a_peg_with_corners_is_studied_with_the_models_that_serve_it_alone():
    models = {
        rung.model.hole
        for rung in (*plan(False, 1, Rectangular(0.008, 0.008)).rungs, *on_trial(Rectangular(0.008, 0.012)))
    }
    assert models == {"exact", "unpredicted"}
    assert {rung.model.hole for rung in plan(False, 1, Round(0.008)).rungs} > models


def test_only_the_rigid_mover_pushes_a_peg_with_corners(config):
    square = load(sets=('sim.pace="max"', "peg.shape=square")).cell
    rows = [hand_rig.measure(kind, square.arm_model(), square.job()) for kind in hand_rig.KINDS]
    assert rows[0].error < 0.003
    assert {row.fault for row in rows[1:]} == {hand_rig.NOT_ROUND}


def test_integration_fails_beyond_the_boundary_of_theory_and_not_below(found):
    for row in found.integration:
        if row.stiffness > boundary_bound(row.timestep):
            assert row.verdict == "unstable"
        elif row.hole == "exact":
            assert row.verdict != "unstable"


def test_the_boundaries_are_those_of_the_linear_maps():
    """Eigenvalues of a bound contact, and the speed after a bounce, at the boundary."""
    dt = 1e-3
    k = boundary_bound(dt)
    b = 2.0 * math.sqrt(k)
    # v' = v - (b v + k r) dt, r' = r + v' dt: trace 2 - (b + k dt) dt, determinant 1 - b dt.
    trace, determinant = 2.0 - (b + k * dt) * dt, 1.0 - b * dt
    root = (trace - math.sqrt(trace**2 - 4.0 * determinant)) / 2.0
    assert root == pytest.approx(-1.0)
    k = boundary_bouncing(dt)
    assert k * dt**2 + 2.0 * math.sqrt(k) * dt - 1.0 == pytest.approx(1.0)


def test_the_full_arm_stays_where_friction_holds_it_and_simpler_ones_do_not(found):
    left = {row.name: row.left for row in found.hands}
    assert left["full arm, hinge"] > 1e-3
    assert left["rigid mover"] == 0.0
    assert left["Cartesian inertia, hinge"] < 1e-4


def test_every_skill_gets_the_shipped_models_from_them(found):
    for need in needed(found):
        assert (need.hole, need.shipped) == (SHIPPED, "yes")


def test_no_skill_gets_steps_that_outrun_the_contacts(found):
    assert SHIPPED_STEP <= found.longest_step < 2.0 * SHIPPED_STEP
    for need in needed(replace(found, longest_step=0.9 * SHIPPED_STEP))[:3]:
        assert (need.hole, need.shipped) == ("", "no")


def test_a_grip_without_friction_never_outruns_them(config):
    slippery = config.model_copy(update={"grip": config.grip.model_copy(update={"friction": 0.0})})
    assert contact.longest_step(slippery) == math.inf


def test_tables_and_pictures_are_written(found, tmp_path: Path):
    written = contact.write(found, tmp_path) + charts.draw(found, tmp_path)
    assert all(path.stat().st_size > 0 for path in written if "outcomes" not in path.name)
    assert len((tmp_path / "contact.csv").read_text().splitlines()) == 1 + len(SMALL.rungs)
    assert len(tables.tables(found)) == 3


@pytest.mark.parametrize("hole", ["unpredicted", "flats", "boxes"])
def test_whole_trials_run_on_other_models(config, hole):
    short = config.model_copy(update={"search": config.search.model_copy(update={"timeout": 1.0})})
    row, _ = contact._trial(short, Rung(hole, "", model(hole=hole, facets=16), 5e-4), 1)
    assert row.stage == "spray_search"
    assert row.peak_contact_force > 1.0


def rows_of(**changes: object) -> list[TrialsRow]:
    """Return trials on the finest rung and on another that ends as they do, but for `changes`."""
    finest = TrialsRow("finest", 5, 5, 0, "", 0, 1e-7, 22.0, 0.0, 2.0, 10.0)
    return [finest, replace(finest, **{"name": "other", "force": 21.0, "force_error": -1.0, **changes})]


def test_trials_end_alike_when_only_their_forces_differ_by_less_than_from_seed_to_seed():
    assert end_alike("other", rows_of())
    assert not end_alike("other", rows_of(force_error=-2.1))
    assert not end_alike("other", rows_of(changed=1))
    assert not end_alike("other", rows_of(voids=1))
    assert not end_alike("another", rows_of())


def test_what_cannot_be_run_is_told_and_is_like_nothing(found):
    trials = [contact._not_run("mover", "not run: why")]
    assert not end_alike("mover", trials)
    table = tables.tables(replace(found, trials=[*rows_of(), *trials]))[2]
    assert "not run: why" in list(table.columns[1].cells)


def test_half_the_clearance_is_half(config):
    assert contact._in_half_the_clearance(config).hole.diameter == pytest.approx(0.00805)
