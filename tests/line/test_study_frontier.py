"""The study of the frontier, with a few short trials: every point is shown, and what was run is not run again."""

import csv
import io
import json
import shutil
from contextlib import redirect_stdout

import pytest

from cell.commands.cli import main
from cell.config.load import load
from cell.lab.frontier import measure as frontier
from cell.lab.frontier.measure import Variant, load_variant, measure
from cell.lab.frontier.methods import METHODS, SCALES, SCENES, TEST, variants
from cell.lab.trials import TABLE, read_table, run_trial

SETS = ("search.timeout=1.0",)
NAMES = ("shipped", "force alone"), ("firm grip",)
QUICK = ["study", "frontier", "--quick", "--json", "--method", "shipped", "--method", "force alone"]
QUICK += ["--scene", "firm grip", "--set", *SETS]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Return what the command printed, and its folder."""
    folder = tmp_path_factory.mktemp("frontier")
    with redirect_stdout(io.StringIO()) as printed:
        assert main([*QUICK, "--out", str(folder)]) == 0
    return json.loads(printed.getvalue()), folder


def test_every_point_has_a_row_of_its_own_trials(study):
    found, folder = study
    with (folder / "frontier.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["variant"] for row in rows] == [line["variant"] for line in found["lines"]]
    for line in found["lines"]:
        trials = read_table(folder / line["folder"] / TABLE)
        assert line["trials"] == len(trials) == 1
        assert line["successes"] == sum(row.outcome == "success" for row in trials)


CHARTS = ("frontier.png", "frontier_errors.png")


def test_charts_are_drawn_again_from_the_table_alone(study, monkeypatch, capsys):
    found, folder = study
    monkeypatch.setattr(frontier, "measure", None)
    for name in CHARTS:
        (folder / name).unlink()
    assert main(["study", "frontier", "--redraw", "--json", "--out", str(folder)]) == 0
    assert json.loads(capsys.readouterr().out) == found
    assert all((folder / name).read_bytes()[:4] == b"\x89PNG" for name in CHARTS)


def test_nothing_to_draw_again_is_told_in_one_line(tmp_path, capsys):
    assert main(["study", "frontier", "--redraw", "--out", str(tmp_path)]) != 0
    assert "frontier.csv" in capsys.readouterr().err


def test_what_was_run_is_taken_up(study, monkeypatch, tmp_path):
    found, folder = study[0], shutil.copytree(study[1], tmp_path / "again")
    monkeypatch.setattr(frontier, "run_trials", None)  # calling it would be an error in the lines
    lines = measure(None, SETS, variants(*NAMES, (1.0,)), range(1, 2), 1, folder, lambda count: None)
    assert [line.error for line in lines] == [""] * len(lines)
    assert [line.endings for line in lines] == [line["endings"] for line in found["lines"]][: len(lines)]


def test_other_seeds_are_run_anew(study, monkeypatch, tmp_path):
    folder = shutil.copytree(study[1], tmp_path / "again")  # in whatever order the tests come, others find their own
    monkeypatch.setattr(frontier, "run_trials", None)
    lines = measure(None, SETS, variants(*NAMES, (1.0,)), range(2, 3), 1, folder, lambda count: None)
    assert all("TypeError" in line.error for line in lines)


def test_a_variant_that_faults_or_is_refused_is_shown_and_the_others_go_on(tmp_path):
    tried = [
        Variant("tried", "refused", None, ("skin.rate=0",)),
        Variant("tried", "blind", None, ("skin.dead_taxels=40",)),
    ]
    done: list[int] = []
    refused, blind = measure(None, (), tried, range(1, 2), 1, tmp_path, done.append)
    assert "skin.rate" in refused.error
    assert refused.trials == 0
    assert (blind.trials, blind.faults, blind.successes) == (1, 1, 0)
    assert "skin_untrusted" in blind.endings
    assert sum(done) == 2


def test_trials_end_where_the_test_answers_and_are_taken_up_with_it(tmp_path):
    tried = [Variant("tried", "blind", None, ("skin.dead_taxels=40",))]
    done: list[int] = []
    [line] = measure(None, (), tried, range(1, 100), 1, tmp_path, done.append, {"tried": TEST})
    assert (line.trials, line.verdict) == (TEST.least, "bad")
    assert sum(done) == 99
    assert measure(None, (), tried, range(1, 100), 1, tmp_path, done.append, {"tried": TEST}) == [line]


@pytest.mark.parametrize("method", ["theta known exactly", "force alone"])
def test_theta_is_what_the_method_says_and_not_what_the_skin_measures(method):
    [tried] = variants([method], ["firm grip"], (1.0,))
    row = run_trial(load_variant(None, tried.preset, tried.sets), 1, program=tried.program)
    assert (row.theta_rmse == 0.0) == (method == "theta known exactly")


def test_every_point_is_a_cell():
    for each in variants(tuple(METHODS), tuple(SCENES), SCALES):
        load(None, each.preset, each.sets)
