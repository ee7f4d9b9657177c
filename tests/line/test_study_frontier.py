"""The study of the frontier with a few short trials: every point is shown, and no trial is repeated."""

import argparse

import pytest

from cell.config.load import load
from cell.lab import trials
from cell.lab.compare import Variant, compared
from cell.lab.frontier.methods import METHODS, SCALES, SCENES, TEST, variants
from cell.lab.trials import TABLE, run_trial
from tests.studies import in_this_process, is_chart, rows_of, studied

SETS = ("search.timeout=1.0",)
NAMES = ("shipped", "force alone"), ("firm grip",)


def args_of(folder, *sets):
    return argparse.Namespace(config=None, set=list(sets), out=folder, workers=1)


def test_every_point_has_its_trials_and_those_are_not_run_again(monkeypatch, tmp_path):
    methods = [word for method in NAMES[0] for word in ("--method", method)]
    found = studied(tmp_path, "frontier", "--quick", *methods, "--scene", *NAMES[1], "--set", *SETS)
    shown = [row["variant"] for row in rows_of(tmp_path / "frontier.csv")]
    assert shown == [line["variant"] for line in found["lines"]]
    for line in found["lines"]:
        of_line = rows_of(tmp_path / line["folder"] / TABLE)
        assert line["trials"] == len(of_line) == 1
        assert line["successes"] == sum(row["outcome"] == "success" for row in of_line)
    assert all(is_chart(tmp_path / name) for name in ("frontier.png", "frontier_errors.png"))
    monkeypatch.setattr(trials, "on_processes", lambda task, seeds, workers, is_over: (None for seed in seeds))
    points = variants(*NAMES, (1.0,))
    lines = compared(args_of(tmp_path, *SETS), points, range(1, 2)).lines
    assert [line.error for line in lines] == [""] * len(lines)
    assert [line.endings for line in lines] == [line["endings"] for line in found["lines"]][: len(lines)]
    assert all(line.error for line in compared(args_of(tmp_path, *SETS), points, range(2, 3)).lines)


def test_trials_end_once_decided_and_are_continued_so(tmp_path):
    tried = [Variant("blind", sets=("skin.dead_taxels=40",))]
    with in_this_process():
        found, again = (compared(args_of(tmp_path), tried, range(1, 100), test=TEST) for _ in range(2))
    assert (found.lines[0].trials, found.lines[0].verdict) == (TEST.every, "0 to 50 %")
    assert again.rows == found.rows


@pytest.mark.parametrize("method", ["theta known exactly", "force alone"])
def test_a_method_replaces_the_measured_theta(method):
    [tried] = variants([method], ["firm grip"], (1.0,))
    row = run_trial(load(None, tried.preset, [*tried.sets, *SETS, "sim.pace=max"]).cell, 1, program=tried.program)
    assert (row.theta_rmse == 0.0) == (method == "theta known exactly")


def test_every_point_is_a_cell():
    """Limits of a speed that hold for the slowest and the fastest hold between."""
    for each in variants(tuple(METHODS), tuple(SCENES), (min(SCALES), max(SCALES))):
        load(None, each.preset, each.sets)
