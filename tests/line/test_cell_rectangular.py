"""A rectangular peg is a config file, and nothing else: it lays a part over the shipped cell, which inserts it."""

from cell.config.load import load
from cell.lab.trials import run_trial

CELL = """base = "sim.toml"
[peg]
shape = "rectangular"
sides = [0.008, 0.012]
[hole]
centre = [0.5, 0.0, 0.1]
area = [0.01, 0.01]
sides = [0.0081, 0.0121]
[rack]
first = [0.45, -0.25, 0.10]
[limits]
force = 60.0
low = [0.20, -0.50, 0.05]
high = [0.80, 0.45, 0.80]
"""


def test_a_rectangular_peg_needs_no_more_than_a_config_file(tmp_path):
    (tmp_path / "cell.toml").write_text(CELL, encoding="utf-8")
    config = load(tmp_path / "cell.toml", sets=["sim.pace=max"]).cell
    rows = [run_trial(config, seed) for seed in (103, 104)]
    assert sum(row.outcome == "success" and row.switch_closed for row in rows) >= 1, rows
    assert max(row.max_penetration for row in rows) < 1e-5
