"""`cell study calibration`: one arm, its figures against what was drawn, its first peg without and with them."""

import json

import pytest

from cell.commands.cli import GOOD, WRONG_USE, main
from cell.lab.calibration import measure


def test_an_unknown_kind_of_arms_is_refused_in_one_line(capsys, tmp_path):
    assert main(["study", "calibration", "--arms", "strong", "--out", str(tmp_path)]) == WRONG_USE
    assert "--arms strong: no such kind; honest arms, careless arms" in capsys.readouterr().err


@pytest.mark.by_hand
@pytest.mark.timeout(3600)
def test_the_quick_study_says_what_was_held_and_what_it_brought(capsys, tmp_path):
    assert main(["study", "calibration", "--quick", "--workers", "1", "--out", str(tmp_path), "--json"]) == GOOD
    (line,) = json.loads(capsys.readouterr().out)["lines"]
    assert (line["kind"], line["figures"]) == (next(iter(measure.SCALES)), 28)
    assert line["held"] >= 26
