"""Memory of a cell from part to part: written whole, read with a guard, forgotten on demand."""

import json
import logging
import os
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from cell.commands.cli import main
from cell.config.load import load
from cell.run.learning import FILE, Learning, digest, forget, hole_found, read_learned
from drivers.errors import ConfigError
from skills.contract import Outcome, Reason
from skills.flow import StageRecord
from skills.search.prior import LearningConfig
from skills.search.spray_search import SpraySearchResult

JOB = load().cell.job()
HOME = (0.51, 0.012)
NOW = datetime(2026, 1, 2, tzinfo=UTC)


def run_at(hole: tuple[float, float], *, is_seated: bool = True) -> list[StageRecord]:
    """Return the search of a run that found a hole."""
    found = SpraySearchResult(
        Outcome.SUCCESS, Reason.NONE, 1.0, (*hole, 0.1), hole, 1, None, edge=hole, seated=hole if is_seated else None
    )
    return [StageRecord("spray_search", found, 0.0, 1.0)]


def learning(folder, now: datetime = NOW, **changes) -> Learning:
    return Learning(folder, LearningConfig(**changes), lambda: now)


def taught(folder, count: int = 3) -> Learning:
    """Return a cell that has seated so many parts at home."""
    cell = learning(folder)
    for _ in range(count):
        cell.take(JOB, 0, run_at(HOME))
    assert cell.flush()
    return cell


def test_a_learnt_place_is_searched_first_after_a_restart(tmp_path):
    assert taught(tmp_path).prepared(JOB, 1).hole.prior is None
    prior = learning(tmp_path).prepared(JOB, 0).hole.prior
    assert prior.mean == pytest.approx(HOME)


def test_a_run_without_a_seated_peg_teaches_nothing(tmp_path):
    cell = learning(tmp_path)
    for _ in range(3):
        cell.take(JOB, 0, run_at(HOME, is_seated=False))
    assert cell.prepared(JOB, 0).hole.prior is None
    assert hole_found(run_at(HOME, is_seated=False)) == HOME
    assert hole_found([]) is None


def test_a_learnt_place_is_that_of_the_same_chamfers():
    plain, chamfered, again = (load(sets=sets).cell.job() for sets in ((), *2 * (("hole.chamfer=0.0005",),)))
    assert digest(plain) != digest(chamfered) == digest(again)


def test_a_cell_without_learning_neither_writes_nor_uses_a_file(tmp_path):
    taught(tmp_path)
    kept = (tmp_path / FILE).read_text()
    cell = learning(tmp_path, place=False)
    cell.take(JOB, 0, run_at(HOME))
    assert cell.prepared(JOB, 0).hole.prior is None
    assert (tmp_path / FILE).read_text() == kept


@pytest.mark.parametrize(("days", "is_used"), [(29.9, True), (30.1, False)])
def test_a_place_that_is_too_old_is_not_used(tmp_path, days, is_used):
    taught(tmp_path)
    later = learning(tmp_path, NOW + timedelta(days=days))
    assert (later.prepared(JOB, 0).hole.prior is not None) is is_used


def test_a_place_learnt_with_another_part_is_not_used(tmp_path, caplog):
    cell = taught(tmp_path)
    other = JOB.model_copy(update={"hole": JOB.hole.model_copy(update={"centre": (0.51, 0.0, 0.1)})})
    with caplog.at_level(logging.WARNING):
        assert cell.prepared(other, 0).hole.prior is None
    assert [record.getMessage() for record in caplog.records] == [
        f"{tmp_path / FILE}: recipe 0: learnt with another part or place: not used"
    ]


@pytest.mark.parametrize(
    ("key", "value", "told", "is_read"),
    [
        ("variance", [-1e-6, 1e-6], "places.0.variance.0", False),
        ("mean", [float("nan"), 0.0], "places.0.mean.0", False),
        ("parts", 0, "places.0.parts", False),
        ("updated", "yesterday", "places.0.updated", False),
        ("mean", [0.6, 0.0], "outside the area of the hole; [0.47, -0.03] to [0.53, 0.03] allowed", True),
    ],
)
def test_an_impossible_file_is_refused_and_fails_no_run(tmp_path, caplog, key, value, told, is_read):
    cell = taught(tmp_path)
    tree = json.loads((tmp_path / FILE).read_text())
    tree["places"]["0"][key] = value
    (tmp_path / FILE).write_text(json.dumps(tree))
    if not is_read:
        with pytest.raises(ConfigError, match=rf"\A[^\n]*{told}[^\n]*\Z"):
            read_learned(tmp_path)
    with caplog.at_level(logging.WARNING):
        assert cell.prepared(JOB, 0).hole.prior is None
    cell.take(JOB, 0, run_at(HOME))
    assert told in caplog.text


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", b'{"version": 2}', b"[]"])
def test_a_torn_or_newer_file_is_refused_and_can_be_forgotten(tmp_path, content, capsys):
    (tmp_path / FILE).write_bytes(content)
    assert main(["learned", "--journal", str(tmp_path)]) == 2
    assert "`cell learned forget` deletes the file" in capsys.readouterr().err.replace("\n", " ")
    assert main(["learned", "forget", "--journal", str(tmp_path)]) == 0
    assert read_learned(tmp_path).places == {}


def test_one_recipe_is_forgotten_and_another_kept(tmp_path):
    cell = taught(tmp_path)
    for _ in range(2):
        cell.take(JOB, 1, run_at(HOME))
    assert cell.flush()
    assert forget(tmp_path, 0) == [0]
    assert forget(tmp_path, 0) == []
    assert list(read_learned(tmp_path).places) == ["1"]
    cell.forget(1)
    assert cell.flush()
    assert read_learned(tmp_path).places == {}


def test_a_hanging_disk_delays_neither_a_run_nor_a_forget(tmp_path, caplog):
    cell, file = taught(tmp_path), tmp_path / FILE
    file.unlink()
    os.mkfifo(file)  # who reads it waits until somebody writes
    prior = cell.prepared(JOB, 0).hole.prior
    assert prior.mean == pytest.approx(HOME)
    assert "the last known content is used" in caplog.text
    cell.forget(0)
    assert cell.prepared(JOB, 0).hole.prior is None
    assert cell.flush()
    assert read_learned(tmp_path).places == {}


def test_the_terminal_shows_learnt_places_and_their_use(tmp_path, capsys):
    taught(tmp_path)
    assert main(["learned", "--json", "--journal", str(tmp_path), "--set", "learning.longest_age=3e7"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row["mean"] == pytest.approx(HOME)
    assert (row["recipe"], row["parts"]) == (0, 3)
    assert main(["learned", "--json", "--journal", str(tmp_path), "--set", "hole.depth=0.015"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row["use"] == "learnt with another part or place"


def test_a_configured_prior_is_used_until_parts_are_learnt(tmp_path):
    job = load(sets=["hole.prior={mean=[0.48,-0.02],deviation=[0.001,0.001]}"]).cell.job()
    cell = learning(tmp_path)
    first = cell.prepared(job, 0).hole.prior
    assert first.mean == (0.48, -0.02)
    for _ in range(2):
        cell.take(job, 0, run_at(HOME))
    learnt = cell.prepared(job, 0).hole.prior
    assert learnt.mean == pytest.approx(HOME)
    assert np.all(np.array(learnt.deviation) < 2e-3)
