"""The study of limits, with two trials: rows, table and chart, what is taken up, drawn again, or ended."""

import csv
import io
import json
import math
from contextlib import redirect_stdout

import pytest

from cell.commands.cli import main
from cell.commands.terminal import GOOD
from cell.lab.frontier.measure import load_variant
from cell.lab.limits import measure as limits
from cell.lab.limits.cases import cases
from cell.lab.limits.lines import Study
from cell.lab.limits.measure import ROWS, measure, read_rows

SETS = ["hole.area=[0.02,0.02]"]
QUICK = ["study", "limits", "--quick", "--json", "--workers", "1", "--seed", "5", "--set", SETS[0]]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Return what the command printed, and its folder."""
    folder = tmp_path_factory.mktemp("limits")
    with redirect_stdout(io.StringIO()) as printed:
        assert main([*QUICK, "--out", str(folder)]) == GOOD
    return json.loads(printed.getvalue()), folder


def test_every_phase_has_its_bound_beside_what_was_reached(study):
    found, folder = study
    with (folder / "limits.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [row["phase"] for row in table] == [line["phase"] for line in found["lines"]]
    phases = {line["phase"]: line for line in found["lines"] if "fast" in line["case"]}
    assert {"turn in the hole", "way down"} <= set(phases)
    assert "fall by 0.3 mm" in {line["phase"] for line in found["lines"]}
    for name in ("turn in the hole", "way down"):
        assert 0.0 < phases[name]["bound"] < phases[name]["reached"]


def test_falls_take_the_time_that_push_and_mass_allow(study):
    _, folder = study
    passes = [each for row in read_rows(folder / ROWS) for each in row.passes]
    assert any(each.is_noticed for each in passes)
    for each in passes:
        assert 3.0 < each.mass < 6.0
        assert each.push == pytest.approx(6.0)


def test_the_band_in_which_a_fall_is_told_lies_nearer_to_the_lowest_point_than_that_of_a_peg_at_rest():
    case = cases(True, True)[0]
    study = Study(case, load_variant(None, None, SETS), [])
    # By `leading`: half of 0.6 mm less half of 0.3 mm, times 1/tan(22.5 degrees) - tan(45 degrees).
    assert study.shift == pytest.approx(0.3e-3 * (1.0 / math.tan(math.pi / 8) - 1.0) / 2.0, rel=1e-3)


def test_rows_and_the_chart_are_written(study):
    _, folder = study
    assert (folder / "limits.png").read_bytes()[:4] == b"\x89PNG"
    assert [row.outcome for row in read_rows(folder / ROWS)] == ["success"] * 2


def test_what_was_run_is_taken_up_and_other_seeds_are_not(study, monkeypatch):
    _, folder = study
    asked = []

    def nothing(task, seeds, workers):
        asked.extend(seeds)
        yield from ()

    monkeypatch.setattr(limits, "on_processes", nothing)
    done = []
    rows = measure(None, SETS, cases(True, True), range(5, 6), 1, folder, done.append)
    assert (asked, sum(done)) == ([], 2)
    assert rows == read_rows(folder / ROWS)
    measure(None, SETS, cases(True, True), range(5, 7), 1, folder, done.append)
    assert asked == [6, 6]


def test_the_rows_are_drawn_again_without_a_trial(study, monkeypatch, capsys):
    found, folder = study
    monkeypatch.setattr(limits, "measure", None)
    (folder / "limits.png").unlink()
    again = ["study", "limits", "--quick", "--json", "--set", SETS[0], "--redraw", "--out", str(folder)]
    assert main(again) == GOOD
    assert json.loads(capsys.readouterr().out) == found
    assert (folder / "limits.png").exists()


def test_an_ended_call_leaves_the_rows_that_it_had(study, monkeypatch, tmp_path):
    _, folder = study
    row = read_rows(folder / ROWS)[0]

    def ended(task, seeds, workers):
        yield row
        raise KeyboardInterrupt

    monkeypatch.setattr(limits, "on_processes", ended)
    with pytest.raises(KeyboardInterrupt):
        measure(None, SETS, cases(True, True), range(5, 8), 1, tmp_path, lambda count: None)
    assert read_rows(tmp_path / ROWS) == [row]


def test_nothing_to_draw_again_is_told_in_one_line(tmp_path, capsys):
    assert main(["study", "limits", "--redraw", "--out", str(tmp_path)]) != GOOD
    assert "limits.jsonl" in capsys.readouterr().err
