"""Reports on runs agree with the rows: in random journals, also after all that happens to a journal."""

import json
import math
import sqlite3
from collections import Counter
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from cell.records.journal import INDEX, Journal
from cell.records.run_query import RunQuery
from cell.records.schema import LAYOUT, RunRow, StageRow
from cell.records.statistics import spread
from cell.records.upkeep import Keep
from cell.report.facts import facts_of
from skills.catalogue import CATALOGUE, GRASP

OUTCOMES = ("success", "failure", "aborted", "fault")
NAMES = (*CATALOGUE.stages.values(), "skill of another cell")


def fill(folder, seed, runs=40):
    """Put runs on record whose figures are drawn, some of them unknown, and leave one open."""
    rng, now = np.random.default_rng(seed), datetime.now(UTC)
    with Journal(folder) as journal:
        for age in np.sort(rng.uniform(0.0, 50.0, runs))[::-1]:
            started = (now - timedelta(days=age)).isoformat(timespec="milliseconds")
            asked = RunRow(0, started, "insert_peg", 1, f"A-{rng.integers(3)}", "plc", 7)
            row = journal.begin(asked)
            outcome = str(rng.choice(OUTCOMES))
            ended = replace(
                row,
                outcome=outcome,
                stage=str(rng.choice(NAMES)),
                reason=str(rng.choice(["", "no_hole", 'it said "no", twice'])),
                fault=int(rng.choice([1001, 2003, 9999])) if outcome == "fault" else 0,
                cycle_time=drawn(rng),
                peak_force=drawn(rng),
            )
            journal.finish(ended, tries(rng, row.run))
        journal.begin(asked)


def tries(rng, run):
    """Return the tries of a run's stages, some more than once."""
    names = rng.choice(NAMES, rng.integers(0, 2 * len(NAMES)))
    return [
        StageRow(run, place, str(name), place, place + rng.random(), counted=drawn(rng), residual=drawn(rng))
        for place, name in enumerate(names, 1)
    ]


def drawn(rng):
    return None if rng.random() < 0.2 else float(rng.random())


def expected(journal, query):
    """Return the facts by the rows themselves, each read and summed up in plain words."""
    rows = [row for row in reversed(journal.select(query)) if row.outcome not in ("running",)]
    tried = {row.run: journal.stages(row.run) for row in rows}
    good = [row for row in rows if row.outcome == "success"]

    def sums(runs, name, what):
        found = ([what(each) for each in tried[row.run] if each.name == name] for row in runs)
        return [[value for value in values if value is not None] for values in found if values]

    times = {}
    for name in CATALOGUE.stages.values():
        counted = [math.fsum(values) for values in sums(good, name, lambda each: each.counted) if values]
        whole = [math.fsum(values) for values in sums(good, name, lambda each: each.ended - each.began)]
        if whole:
            times[name] = (len(whole), spread(counted), spread(whole))
    insertions = [
        [each.counted for each in tried[row.run] if each.name in CATALOGUE.counted and each.counted is not None]
        for row in good
    ]
    return {
        "outcomes": Counter(row.outcome for row in rows),
        "cycle": spread([row.cycle_time for row in good if row.cycle_time is not None]),
        "forces": [row.peak_force for row in rows if row.peak_force is not None],
        "insertion": spread([math.fsum(values) for values in insertions if values]),
        "stages": times,
        "residuals": [max(values) for values in sums(rows, GRASP.name, lambda each: each.residual) if values],
        "days": Counter(datetime.fromisoformat(row.started).astimezone().date().isoformat() for row in rows),
        "lost": sum(row.outcome != "success" for row in rows),
        "first": rows[0].started if rows else "",
        "last": rows[-1].started if rows else "",
    }


def agree(folder):
    """Demand that the report of every question is that of the rows."""
    with Journal(folder, is_read_only=True) as journal:
        assert journal.runs(1)
        since = (datetime.now(UTC) - timedelta(days=20)).isoformat(timespec="milliseconds")
        for query in (RunQuery(), RunQuery(since), RunQuery(serial="A-1"), RunQuery(outcome="fault"), RunQuery("9")):
            facts, wanted = facts_of(journal.told(query)), expected(journal, query)
            assert facts.outcomes == wanted["outcomes"]
            assert {day: of_day.runs for day, of_day in facts.by_day} == wanted["days"]
            assert sum(loss.count for loss in facts.losses) == wanted["lost"]
            assert (facts.first, facts.last) == (wanted["first"], wanted["last"])
            assert [*facts.forces] == wanted["forces"]
            assert [residual for _, residual in facts.residuals] == wanted["residuals"]
            assert near(facts.cycle, wanted["cycle"])
            assert near(facts.insertion, wanted["insertion"])
            assert {stage.name for stage in facts.stages} == wanted["stages"].keys()
            for stage in facts.stages:
                n, counted, whole = wanted["stages"][stage.name]
                assert stage.n == n
                assert near(stage.counted, counted)
                assert near(stage.whole, whole)


def near(found, wanted):
    return found is wanted is None or found == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("seed", [103001, 103002, 103003])
def test_a_report_of_random_runs_is_that_of_their_rows(tmp_path, seed):
    fill(tmp_path, seed)
    agree(tmp_path)


def test_it_still_is_after_a_program_was_killed_and_old_runs_were_deleted(tmp_path):
    fill(tmp_path, 103004)
    with closing(sqlite3.connect(tmp_path / INDEX)) as index, index:
        before = index.execute("SELECT count(*) FROM told").fetchone()[0]
    with Journal(tmp_path, keep=Keep(days=30)) as journal:
        assert {row.outcome for row in journal.runs(1)} == {"lost"}
    with closing(sqlite3.connect(tmp_path / INDEX)) as index:
        assert 0 < index.execute("SELECT count(*) FROM told").fetchone()[0] < before
    agree(tmp_path)


def test_it_still_is_of_an_index_that_was_made_again(tmp_path):
    fill(tmp_path, 103005)
    index = tmp_path / INDEX
    index.write_bytes(b"\x00" * index.stat().st_size)
    with Journal(tmp_path):
        pass
    with closing(sqlite3.connect(index)) as opened:
        assert opened.execute("PRAGMA user_version").fetchone()[0] == LAYOUT
        told = {run: json.loads(kind) for run, kind in opened.execute("SELECT run, kind FROM told")}
    assert len(told) > 40
    agree(tmp_path)
