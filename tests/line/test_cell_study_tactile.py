import csv
import io
import json
from contextlib import redirect_stdout

import pytest

from cell.commands.cli import main
from cell.lab.tactile import CONDITIONS, ESTIMATORS, ON_LAYER


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Return what the command printed, and its folder."""
    folder = tmp_path_factory.mktemp("study")
    with redirect_stdout(io.StringIO()) as printed:
        assert main(["study", "tactile", "--quick", "--json", "--out", str(folder)]) == 0
    return json.loads(printed.getvalue()), folder


def _line(found, layout, condition, estimator, model="springs"):
    return next(
        line
        for line in found["lines"]
        if (line["layout"], line["condition"], line["estimator"], line["model"])
        == (layout, condition, estimator, model)
    )


def test_every_estimator_meets_every_condition_on_both_layouts(study):
    found, folder = study
    with (folder / "tactile.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(found["lines"]) == 2 * len(ESTIMATORS) * (len(CONDITIONS) + len(ON_LAYER))


def test_the_chart_is_drawn(study):
    _, folder = study
    assert (folder / "tactile_speed_accuracy.png").read_bytes()[:4] == b"\x89PNG"


def test_robust_estimator_reaches_the_goals_on_the_parallelogram(study):
    found, _ = study
    nominal = _line(found, "parallelogram", "nominal", "robust")
    assert nominal["told"] == 1.0
    assert nominal["rmse"] < 0.8
    assert nominal["worst"] < 5.0
    for condition in ("module dead, known", "module dead, unknown"):
        assert _line(found, "parallelogram", condition, "robust")["rmse"] < 1.2
