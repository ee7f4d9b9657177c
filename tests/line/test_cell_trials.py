"""Trials on real worker processes: the same rows whatever their number."""

from dataclasses import replace

from cell.config.load import load
from cell.lab.trials import run_trial, run_trials

SHORT = ["search.timeout=2.0"]


def test_rows_do_not_depend_on_the_number_of_workers(tmp_path):
    config = load(sets=SHORT).cell
    by_two = run_trials(config, range(5, 8), 2, tmp_path, lambda row: None)
    alone = [run_trial(config, seed) for seed in range(5, 8)]
    assert [replace(row, wall_time=0.0) for row in by_two] == [replace(row, wall_time=0.0) for row in alone]


def test_every_seed_draws_its_own_hole_and_start():
    config = load(sets=SHORT).cell
    rows = [run_trial(config, seed) for seed in (1, 2)]
    assert len({(row.hole_x, row.hole_y) for row in rows}) == 2
    assert len({(row.start_x, row.start_y) for row in rows}) == 2
