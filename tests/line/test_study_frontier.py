"""The study of the frontier, with a few short trials: every variant is shown, and what was run is not run again."""

import csv
import io
import json
import shutil
from contextlib import redirect_stdout
from dataclasses import replace
from itertools import pairwise

import pytest

from cell.commands.cli import main
from cell.config.files import presets
from cell.config.load import load
from cell.lab.frontier import measure as frontier
from cell.lab.frontier.measure import Variant, measure
from cell.lab.frontier.variants import CHAIN, COARSE, PRESET, PUBLISHED, START, SWEEPS, chain, rate_tests, variants
from cell.lab.trials import TABLE, read_table

QUICK = ["study", "frontier", "--quick", "--json", "--trials", "1", "--set", "search.timeout=1.0"]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Return what the command printed, and its folder."""
    folder = tmp_path_factory.mktemp("frontier")
    with redirect_stdout(io.StringIO()) as printed:
        assert main([*QUICK, "--out", str(folder)]) == 0
    return json.loads(printed.getvalue()), folder


def test_every_variant_has_a_row_of_its_own_trials(study):
    found, folder = study
    with (folder / "frontier.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["variant"] for row in rows] == [line["variant"] for line in found["lines"]]
    for line in found["lines"]:
        trials = read_table(folder / line["folder"] / TABLE)
        assert line["trials"] == len(trials) == 1
        assert line["successes"] == sum(row.outcome == "success" for row in trials)


def test_variants_of_the_same_config_share_their_trials(study):
    found, _ = study
    first = {line["family"]: line for line in reversed(found["lines"])}
    last = found["lines"][-1]
    assert last["family"] == CHAIN
    assert last["is_base"]
    assert last["folder"] == first[PRESET]["folder"]


CHARTS = ("frontier.png", "frontier_panels.png", "chain.png")


def test_every_chart_is_drawn(study):
    _, folder = study
    for name in CHARTS:
        assert (folder / name).read_bytes()[:4] == b"\x89PNG"


def test_charts_are_drawn_again_from_the_tables_alone(study, monkeypatch, capsys):
    found, folder = study
    monkeypatch.setattr(frontier, "measure", None)
    for name in CHARTS:
        (folder / name).unlink()
    assert main(["study", "frontier", "--redraw", "--json", "--out", str(folder)]) == 0
    assert json.loads(capsys.readouterr().out) == found
    assert all((folder / name).exists() for name in CHARTS)


def test_nothing_to_draw_again_is_told_in_one_line(tmp_path, capsys):
    assert main(["study", "frontier", "--redraw", "--out", str(tmp_path)]) != 0
    assert "frontier.csv" in capsys.readouterr().err


def test_a_group_that_is_not_there_is_told_with_those_that_are(tmp_path, capsys):
    assert main(["study", "frontier", "--quick", "--only", "presett", "--out", str(tmp_path)]) == 2
    assert "did you mean preset" in capsys.readouterr().err


def test_what_was_run_is_taken_up(study, monkeypatch, tmp_path):
    found, folder = study[0], shutil.copytree(study[1], tmp_path / "again")
    monkeypatch.setattr(frontier, "run_trials", None)  # calling it would be an error in the lines
    sets = ["search.timeout=1.0"]
    lines = measure(None, sets, variants(None, sets, True), range(1, 2), 1, folder, lambda count: None)
    assert [line.error for line in lines] == [""] * len(found["lines"])
    assert [line.endings for line in lines] == [line["endings"] for line in found["lines"]]


def test_other_seeds_are_run_anew(study, monkeypatch, tmp_path):
    folder = shutil.copytree(study[1], tmp_path / "again")  # in whatever order the tests come, others find their own
    monkeypatch.setattr(frontier, "run_trials", None)
    sets = ["search.timeout=1.0"]
    lines = measure(None, sets, variants(None, sets, True), range(2, 3), 1, folder, lambda count: None)
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
    [line] = measure(None, (), tried, range(1, 100), 1, tmp_path, done.append, {"tried": COARSE})
    assert (line.trials, line.verdict) == (COARSE.least, "bad")
    assert sum(done) == 99
    assert measure(None, (), tried, range(1, 100), 1, tmp_path, done.append, {"tried": COARSE}) == [line]


def test_every_group_has_a_test():
    assert (
        set(rate_tests())
        == {variant.family for variant in variants(None, (), False)}
        == {PRESET, PUBLISHED, *SWEEPS, CHAIN}
    )


def test_the_chain_ends_in_the_shipped_cell():
    start, end = load(preset=START).cell, load().cell
    steps = chain(start, end)
    assert load(preset=START, sets=steps[0].sets).cell == start
    assert load(preset=START, sets=steps[-1].sets).cell == end.model_copy(update={"preset": START})


def test_the_chain_from_the_laboratory_ends_in_the_shipped_cell_whose_board_is_moved():
    end, [_, there] = load().cell, [each for each in variants(None, (), False) if each.family == PUBLISHED]
    steps = [each for each in variants(None, (), False) if each.family == CHAIN]
    first, last = (load(preset=START, sets=each.sets).cell for each in (steps[0], steps[-1]))
    assert first == load(preset=START, sets=there.sets).cell
    assert first.sim is not None
    assert first.sim.fixture is not None
    assert first.sim.fixture.mean == end.hole.centre[:2]
    assert last == end.model_copy(update={"preset": START})


def test_each_step_of_the_chain_adds_keys_and_keeps_those_before():
    steps = chain(load(preset=START).cell, load().cell)
    for before, after in pairwise(steps):
        assert after.sets[: len(before.sets)] == before.sets
        assert len(after.sets) > len(before.sets)
        assert after == replace(before, name=after.name, sets=after.sets)


def test_every_preset_and_every_swept_value_is_a_cell():
    tried = variants(None, (), False)
    assert {v.preset for v in tried if v.family in (PRESET, PUBLISHED)} == {None, *presets()}
    for variant in tried:
        load(None, variant.preset, variant.sets)
