"""The study of estimators: each meets every condition, and the robust one reaches its goals."""

from cell.lab.tactile import CONDITIONS, ESTIMATORS, ON_LAYER
from tests.studies import is_chart, rows_of

STUDY = ("tactile", "--quick")


def test_every_estimator_meets_every_condition_on_both_layouts_and_the_chart_is_drawn(study):
    found, folder = study
    rows = rows_of(folder / "tactile.csv")
    assert len(rows) == len(found["lines"]) == 2 * len(ESTIMATORS) * (len(CONDITIONS) + len(ON_LAYER))
    assert is_chart(folder / "tactile_speed_accuracy.png")


def test_robust_estimator_reaches_the_goals_on_the_parallelogram(study):
    lines = {
        line["condition"]: line
        for line in study[0]["lines"]
        if (line["layout"], line["estimator"], line["model"]) == ("parallelogram", "robust", "springs")
    }
    assert lines["nominal"]["told"] == 1.0
    assert lines["nominal"]["rmse"] < 0.8
    assert lines["nominal"]["worst"] < 5.0
    for condition in ("module dead, known", "module dead, unknown"):
        assert lines[condition]["rmse"] < 1.2
