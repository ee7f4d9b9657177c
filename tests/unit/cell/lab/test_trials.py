"""Trials give the promised table and summary, for any order of finish and after a kill."""

import io
import json
import re
from dataclasses import asdict, replace

import pytest
from rich.console import Console

from cell.lab import trials
from cell.lab.tables import loads, phases
from cell.lab.trials import PARTIAL, run_trials, summarise, write_table
from cell.records.provenance import config_hash, versions
from drivers.errors import ConfigError
from tests.studies import rows_of
from tests.trial_rows import SEATED

ROW = replace(
    SEATED, seed=3, grasp_time=3.0, search_time=10.0, insert_time=4.0, total_time=16.0, peak_contact_force=17.0
)
LOST = replace(ROW, seed=4, outcome="failure", insert_time=None, adjust_time=None, switch_closed=False)


@pytest.fixture
def ran(monkeypatch):
    """Replace the worker pool; return the seeds that were really run."""
    seeds = []

    def on_processes(task, missing, workers, is_enough):
        for seed in missing:
            seeds.append(seed)
            yield replace(ROW, seed=seed)

    monkeypatch.setattr(trials, "on_processes", on_processes)
    return seeds


def test_the_table_has_the_promised_columns_and_empty_cells(tmp_path):
    drawn = {"reality.arm.gravity": "0.1 -0.2", "reality.skin.age": "0.01"}
    write_table([replace(ROW, more=drawn), replace(LOST, more=drawn)], tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_text().splitlines()[0] == (
        "seed,outcome,reason,stage,grasp_time,search_time,insert_time,adjust_time,total_time,retries,peak_contact_force,"
        "max_penetration,max_in_hand_rotation,theta_rmse,tip_rmse,hole_x,hole_y,start_x,start_y,switch_closed,depth,"
        "sim_time,wall_time,cycle_time,time_over_20N,plate_penetration,grip_slip,found_error,jerk_free,jerk_contact,"
        "reality.arm.gravity,reality.skin.age"
    )
    seated, row = rows_of(tmp_path / "t.csv")
    assert (row["insert_time"], row["search_time"], row["switch_closed"]) == ("", "10.0", "false")
    assert drawn.items() <= seated.items() & row.items()


def test_a_summary_has_the_config_and_counts_voids_as_failures(loaded):
    summary = summarise([ROW, replace(ROW, seed=4, outcome="void")], loaded.cell)
    assert (summary["success_rate"], summary["outcomes"]["void"]) == (0.5, 1)
    assert summary["config"]["peg"]["diameter"] == loaded.cell.peg.diameter


def test_times_are_those_of_the_successes(loaded):
    summary = summarise([ROW, LOST], loaded.cell)
    assert summary["times"]["total_time"] == {"mean": 16.0, "median": 16.0, "p95": 16.0, "n": 1}


@pytest.mark.parametrize("order", [(1, 2, 3, 4, 5, 6), (3, 1, 2, 6, 5, 4), (6, 5, 4, 3, 2, 1)])
def test_rows_end_with_the_first_seeds_in_any_order_of_finish(loaded, monkeypatch, tmp_path, order):
    def on_processes(task, missing, workers, is_enough):
        for seed in order:
            yield replace(ROW, seed=seed)
            if is_enough():
                return

    monkeypatch.setattr(trials, "on_processes", on_processes)
    rows = run_trials(loaded.cell, range(1, 7), 2, tmp_path, lambda row: None, is_enough=lambda rows: len(rows) >= 3)
    assert [row.seed for row in rows] == [1, 2, 3]
    assert [row["seed"] for row in rows_of(tmp_path / "trials.csv")] == ["1", "2", "3"]


def interrupted(folder, config, rows, rest=""):
    """Leave behind what a killed call leaves."""
    head = {"config": config_hash(config), "versions": versions()}
    lines = [json.dumps(entry) for entry in (head, *map(asdict, rows))]
    (folder / PARTIAL).write_text("\n".join(lines) + "\n" + rest)


def test_a_killed_call_is_resumed_and_a_longer_one_continues(loaded, ran, tmp_path):
    interrupted(tmp_path, loaded.cell, [replace(ROW, seed=1), replace(ROW, seed=3)], rest='{"seed": 2, "outc')
    done = []
    rows = run_trials(loaded.cell, [3, 1, 2], 2, tmp_path, done.append)
    assert (ran, [row.seed for row in rows], len(done)) == ([2], [1, 2, 3], 3)
    rows = run_trials(loaded.cell, [1, 2, 3, 4], 2, tmp_path, done.append)
    assert (ran, len(rows)) == ([2, 4], 4)


def test_a_call_killed_while_it_takes_up_loses_nothing(loaded, monkeypatch, tmp_path):
    interrupted(tmp_path, loaded.cell, [replace(ROW, seed=1), replace(ROW, seed=3)], rest=json.dumps(asdict(LOST)))
    left = []

    def killed(task, missing, workers, is_enough):
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


def test_a_folder_that_cannot_be_made_is_refused(loaded, ran, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="--out"):
        run_trials(loaded.cell, [1], 1, tmp_path / "file" / "out", lambda row: None)


def test_the_summary_has_forces_and_jerks(loaded):
    told = summarise([ROW, replace(ROW, seed=4, peak_contact_force=23.0, time_over_20N=0.3)], loaded.cell)["loads"]
    assert (told["peak_contact_force"]["largest"], told["time_over_20N"]["largest"]) == (23.0, 0.3)
    assert told["jerk_contact"] == {"mean": 300.0, "median": 300.0, "p95": 300.0, "n": 2, "largest": 300.0}


def printed(table):
    """Return a table as on a terminal of 80 columns."""
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(table)
    return console.export_text()


def test_the_table_of_loads_counts_trials_within_20_newtons():
    told = printed(loads([ROW, replace(ROW, seed=4, peak_contact_force=23.0, time_over_20N=0.3)]))
    assert "1 of 2 trials within 20 N" in told
    assert re.search(r"time above 20 N \(s\) +│ +0\.15 │ +0\.2\d │ +0\.30", told)


def test_the_parts_of_a_cycle_add_up_to_it():
    told = printed(phases([replace(ROW, adjust_time=2.0, cycle_time=25.0), replace(ROW, outcome="failure")]))
    assert re.search(r"transfers and release +│ +6\.0 │ +24 ", told)
