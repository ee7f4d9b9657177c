"""A whole insertion on another arm, which is a file of figures and nothing else."""

import pytest

from cell.config.files import DEFAULT, arm_file
from cell.config.load import load
from cell.lab.trials import run_trial

OTHER = f"""
base = "{arm_file("fr3")}"
name = "An FR3 with longer links and fingers, which nobody builds"

[kinematics]
d = [0.35, 0.0, 0.33, 0.0, 0.384, 0.0, 0.0]
flange = 0.125

[hand]
finger_centre = 0.1134
finger_offset = -0.0084
finger_radius = 0.022
finger = {{ mass = 0.062, com = [0.0, 0.0153, -0.028], inertia = [2.6e-5, 2.6e-5, 4e-6, 0.0, 0.0, -2e-6] }}
"""


@pytest.mark.parametrize("model", ["fr3", "fr3v2", "longer.toml"])
def test_another_arm_inserts_a_peg(model, tmp_path):
    (tmp_path / "longer.toml").write_text(OTHER, encoding="utf-8")
    (tmp_path / "cell.toml").write_text(DEFAULT.read_text(encoding="utf-8"), encoding="utf-8")
    row = run_trial(load(tmp_path / "cell.toml", sets=[f"arm.model={model}", "reality.scale=0.0"]).cell, 24001)
    assert (row.outcome, row.switch_closed) == ("success", True), row
