"""The study of limits, with one trial: every phase takes at least the time of its bound."""

import pytest

from cell.lab.limits import COVER, DAMPED, DOWN, TURN, WALLS
from tests.studies import is_chart, rows_of

STUDY = ("limits", "--quick", "--workers", "1", "--seed", "5", "--set", "hole.area=[0.02,0.02]")


@pytest.mark.parametrize("phase", [TURN, DOWN, DAMPED])
def test_no_phase_is_quicker_than_its_bound(study, phase):
    for line in study[0]["lines"]:
        if line["phase"] == phase:
            assert 0.0 < line["bound"] < line["reached"]


def test_every_phase_has_a_line(study):
    found, folder = study
    phases = [("default", phase) for phase in (COVER, TURN, DOWN, DAMPED, WALLS)]
    assert [(line["variant"], line["phase"]) for line in found["lines"]] == phases
    assert len(rows_of(folder / "limits.csv")) == len(phases)
    assert is_chart(folder / "limits.png")
