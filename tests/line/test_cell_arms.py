"""A whole insertion on another arm, which is a file of figures and nothing else."""

import pytest

from cell.config.files import DEFAULT, arm_file
from cell.config.load import load
from cell.lab.trials import run_trial

OTHER = {"d = [0.333, 0.0, 0.316,": "d = [0.35, 0.0, 0.33,", "flange = 0.107": "flange = 0.125"}
"""An FR3 with longer links, which nobody builds."""


@pytest.mark.parametrize("model", ["fr3", "longer.toml"])
def test_another_arm_inserts_a_peg(model, tmp_path):
    text = arm_file("fr3").read_text(encoding="utf-8")
    for figures, other in OTHER.items():
        assert figures in text
        text = text.replace(figures, other)
    (tmp_path / "longer.toml").write_text(text, encoding="utf-8")
    (tmp_path / "cell.toml").write_text(DEFAULT.read_text(encoding="utf-8"), encoding="utf-8")
    row = run_trial(load(tmp_path / "cell.toml", sets=[f"arm.model={model}", "reality.scale=0.0"]).cell, 24001)
    assert (row.outcome, row.switch_closed) == ("success", True), row
