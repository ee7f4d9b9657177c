"""The ladder of contact models in its smallest form: everything is measured, marked and drawn, and nothing is dropped."""

import math

import pytest

from cell.lab import contact
from cell.lab.charts import draw_panels
from cell.lab.contact import HOLES, SHIPPED, Rung, boundary_bouncing, boundary_bound, ladder, model, verdict
from cell.lab.rows import write_rows
from drivers.part.rectangular import Rectangular
from drivers.part.round import Round
from tests.studies import is_chart, rows_of

PEG, HOLE = Round(0.008), Round(0.0081)
EXACT = Rung(SHIPPED, "closed form", model(), 5e-4)
RUNGS = {
    EXACT: "good",
    Rung("16 boxes, 1 ms", "boxes, native CCD", model(facets=16, hole="boxes", native_ccd=True), 1e-3): "void",
    Rung("far too stiff", "closed form", model(stiffness=1e9), 5e-4): "does not rest",
    Rung("no time step", "closed form", model(), 0.0): "Error",
}
"""Contact models, and a part of the verdict on each."""


def test_contact_models_are_judged_and_unstable_beyond_the_boundary(tmp_path):
    rungs = [contact.measure_rung(rung, (0.3,), PEG, HOLE) for rung in RUNGS]
    for row, word in zip(rungs, RUNGS.values(), strict=True):
        assert word in verdict(row)
    assert rungs[0].error < 0.003
    assert rungs[0].penetration < 1e-6
    points = [
        contact.measure_point(kind, dt, k, PEG, HOLE) for kind in HOLES for dt in (2.5e-4, 1e-3) for k in (1e5, 1e8)
    ]
    for row in points:
        if row.stiffness > boundary_bound(row.timestep):
            assert row.verdict == "unstable"
        elif row.hole == "exact":
            assert row.verdict != "unstable"
    assert len(rows_of(write_rows(rungs, tmp_path / "contact.csv"))) == len(rungs)
    panels = [contact.ladder_panel(rungs, "8 mm in 8.1 mm"), *contact.map_panels(points)]
    assert is_chart(draw_panels(panels, "title", tmp_path / "contact.png"))


@pytest.mark.parametrize("sides", [(0.008, 0.008), (0.008, 0.012)])
def test_the_shipped_model_is_good_for_a_peg_with_corners_too(sides):
    peg = Rectangular(*sides)
    row = contact.measure_rung(EXACT, (0.3, 1.7), peg, peg.grown(5e-5))
    assert verdict(row) == "good", row
    assert row.penetration < 1e-6


def test_a_peg_with_corners_is_studied_with_its_models_alone():
    models = {rung.model.hole for rung in ladder(Rectangular(0.008, 0.008))}
    assert models == {"exact", "unpredicted"}
    assert {rung.model.hole for rung in ladder(PEG)} > models


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
