import csv
import io
import json
import re
from dataclasses import asdict, replace

import pytest
from rich.console import Console

from cell.lab import trials
from cell.lab.tables import loads, phases
from cell.lab.trials import COLUMNS, MORE, PARTIAL, read_table, run_trials, summarise, write_table
from cell.records.provenance import config_hash, versions
from drivers.errors import ConfigError
from tests.trial_rows import SEATED

ROW = replace(
    SEATED,
    seed=3,
    grasp_time=3.0,
    search_time=10.0,
    insert_time=4.0,
    total_time=16.0,
    peak_contact_force=17.0,
    max_penetration=1e-7,
    max_in_hand_rotation=0.5,
    theta_rmse=0.07,
    tip_rmse=0.003,
    hole_y=0.01,
    start_x=0.51,
    start_y=-0.01,
    sim_time=25.0,
    wall_time=1.5,
    time_over_20N=0.0,
    plate_penetration=1e-7,
    grip_slip=0.0,
)
LOST = replace(
    ROW,
    seed=4,
    outcome="failure",
    reason="no_hole",
    stage="spray_search",
    insert_time=None,
    adjust_time=None,
    switch_closed=False,
)


@pytest.fixture
def ran(monkeypatch):
    """Replace the worker pool; return the seeds that were really run."""
    seeds = []

    def on_processes(task, missing, workers):
        for seed in missing:
            seeds.append(seed)
            yield replace(ROW, seed=seed)

    monkeypatch.setattr(trials, "on_processes", on_processes)
    return seeds


def test_the_table_has_the_promised_columns(tmp_path):
    write_table([ROW, LOST], tmp_path / "t.csv")
    head, *rows = (tmp_path / "t.csv").read_text().splitlines()
    assert head == (
        "seed,outcome,reason,stage,grasp_time,search_time,insert_time,adjust_time,total_time,retries,peak_contact_force,"
        "max_penetration,max_in_hand_rotation,theta_rmse,tip_rmse,hole_x,hole_y,start_x,start_y,switch_closed,depth,"
        "sim_time,wall_time,cycle_time,time_over_20N,plate_penetration,grip_slip,found_error,jerk_free,jerk_contact"
    )
    assert len(rows) == 2


def test_a_stage_that_was_not_reached_is_empty(tmp_path):
    write_table([LOST], tmp_path / "t.csv")
    with (tmp_path / "t.csv").open() as file:
        row = next(csv.DictReader(file))
    assert (row["insert_time"], row["search_time"], row["switch_closed"]) == ("", "10.0", "false")


def test_a_void_counts_as_a_failure(loaded):
    summary = summarise([ROW, replace(ROW, seed=4, outcome="void")], loaded.cell)
    assert (summary["success_rate"], summary["outcomes"]["void"]) == (0.5, 1)


def test_times_are_those_of_the_successes(loaded):
    summary = summarise([ROW, LOST], loaded.cell)
    assert summary["times"]["total_time"] == {"mean": 16.0, "median": 16.0, "p95": 16.0, "n": 1}


def test_the_summary_has_the_whole_config(loaded):
    assert summarise([ROW], loaded.cell)["config"]["peg"]["diameter"] == loaded.cell.peg.diameter


def test_rows_are_sorted_by_seed(loaded, ran, tmp_path):
    rows = run_trials(loaded.cell, [9, 7, 8], 2, tmp_path, lambda row: None)
    assert [row.seed for row in rows] == [7, 8, 9]


@pytest.mark.parametrize("order", [(1, 2, 3, 4, 5, 6), (3, 1, 2, 6, 5, 4), (6, 5, 4, 3, 2, 1)])
def test_rows_end_with_the_least_number_of_first_seeds_that_is_enough_in_whatever_order_they_finish(
    loaded, monkeypatch, tmp_path, order
):
    def on_processes(task, missing, workers):
        yield from (replace(ROW, seed=seed) for seed in order)

    monkeypatch.setattr(trials, "on_processes", on_processes)
    rows = run_trials(loaded.cell, range(1, 7), 2, tmp_path, lambda row: None, is_enough=lambda rows: len(rows) >= 3)
    assert [row.seed for row in rows] == [1, 2, 3]
    assert [row.seed for row in read_table(tmp_path / "trials.csv")] == [1, 2, 3]


def interrupted(folder, config, rows, rest=""):
    """Leave behind what a killed call leaves."""
    head = {"config": config_hash(config), "versions": versions()}
    lines = [json.dumps(entry) for entry in (head, *map(asdict, rows))]
    (folder / PARTIAL).write_text("\n".join(lines) + "\n" + rest)


def test_a_killed_call_is_taken_up_where_it_was(loaded, ran, tmp_path):
    interrupted(tmp_path, loaded.cell, [replace(ROW, seed=1), replace(ROW, seed=3)], rest='{"seed": 2, "outc')
    done = []
    rows = run_trials(loaded.cell, [1, 2, 3], 2, tmp_path, done.append)
    assert (ran, len(rows), len(done)) == ([2], 3, 3)


def test_a_longer_call_runs_only_the_missing_seeds(loaded, ran, tmp_path):
    run_trials(loaded.cell, [1, 2], 2, tmp_path, lambda row: None)
    rows = run_trials(loaded.cell, [1, 2, 3], 2, tmp_path, lambda row: None)
    assert (ran, len(rows)) == ([1, 2, 3], 3)


def test_a_call_killed_while_it_takes_up_loses_nothing(loaded, monkeypatch, tmp_path):
    interrupted(tmp_path, loaded.cell, [replace(ROW, seed=1), replace(ROW, seed=3)], rest=json.dumps(asdict(LOST)))
    left = []

    def killed(task, missing, workers):
        left.extend((tmp_path / PARTIAL).read_text().splitlines()[1:])
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr(trials, "on_processes", killed)
    with pytest.raises(KeyboardInterrupt):
        run_trials(loaded.cell, [1, 2, 3], 2, tmp_path, lambda row: None)
    assert [json.loads(line)["seed"] for line in left] == [1, 3]


def test_another_config_starts_anew(loaded, ran, tmp_path):
    interrupted(tmp_path, loaded.cell.model_copy(update={"scan_rate": 50.0}), [replace(ROW, seed=1)])
    run_trials(loaded.cell, [1, 2], 2, tmp_path, lambda row: None)
    assert ran == [1, 2]


def test_a_folder_that_cannot_be_made_is_told(loaded, ran, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="--out"):
        run_trials(loaded.cell, [1], 1, tmp_path / "file" / "out", lambda row: None)


def test_the_columns_are_the_rows_fields():
    assert list(asdict(ROW)) == [*COLUMNS, MORE]


def test_what_was_drawn_of_the_errors_stands_in_columns_of_its_own_and_is_read_back(tmp_path):
    drawn = {"reality.arm.gravity": "0.1 -0.2", "reality.skin.age": "0.01"}
    rows = [replace(ROW, seed=1, more=drawn, start_x=0.5), replace(ROW, seed=2, more=drawn, start_x=0.5)]
    write_table(rows, tmp_path / "t.csv")
    assert (
        (tmp_path / "t.csv")
        .read_text()
        .splitlines()[0]
        .endswith("plate_penetration,grip_slip,found_error,jerk_free,jerk_contact,reality.arm.gravity,reality.skin.age")
    )
    assert [row.more for row in read_table(tmp_path / "t.csv")] == [drawn, drawn]


def test_the_summary_tells_how_hard_and_how_abruptly(loaded):
    told = summarise([ROW, replace(ROW, seed=4, peak_contact_force=23.0, time_over_20N=0.3)], loaded.cell)["loads"]
    assert (told["peak_contact_force"]["largest"], told["time_over_20N"]["largest"]) == (23.0, 0.3)
    assert told["jerk_contact"] == {"mean": 300.0, "median": 300.0, "p95": 300.0, "n": 2, "largest": 300.0}


def test_the_table_of_loads_fits_eighty_columns_and_counts_what_keeps_to_20_newtons():
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(loads([ROW, replace(ROW, seed=4, peak_contact_force=23.0, time_over_20N=0.3)]))
    told = console.export_text()
    assert "1 of 2 trials within 20 N" in told
    assert re.search(r"time above 20 N \(s\) +│ +0\.15 │ +0\.2\d │ +0\.30", told)


def test_the_parts_of_a_cycle_add_up_to_it():
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(phases([replace(ROW, adjust_time=2.0, cycle_time=25.0), replace(ROW, outcome="failure")]))
    assert re.search(r"transfers and release +│ +6\.0 │ +24 ", console.export_text())
