"""Reports on random runs agree with plain sums over the rows, and with another program that reads their export."""

import json
import math
import time
from collections import Counter, defaultdict
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from statistics import mean

import numpy as np
import pytest

from cell.commands.cli import GOOD, main
from cell.records.journal import Journal
from cell.records.run_query import RunQuery
from cell.records.schema import EventKind, EventRow, RunRow, StageRow
from cell.records.statistics import spread
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
            row = journal.writer.begin(asked)
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
            journal.writer.finish(ended, tries(rng, row.run))
            if outcome == "fault":
                stop(journal, row, float(rng.exponential(4.0)))
        journal.writer.begin(asked)


def stop(journal, row, hours):
    """Put on record that the cell was aborted at the start of a run, and reset some hours later."""
    began = datetime.fromisoformat(row.started)
    for later, name, before in (
        (0.0, "ABORTING", "EXECUTE"),
        (0.0, "ABORTED", "ABORTING"),
        (hours, "RESETTING", "STOPPED"),
    ):
        at = (began + timedelta(hours=later)).isoformat(timespec="milliseconds")
        journal.writer.note(EventRow(0, at, 1.0, EventKind.STATE, name, run=row.run, text=before))


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
        "shifts": shifts(rows, journal.events()),
        "trend": trend(good, tried),
        "lost": losses(rows),
        "first": rows[0].started if rows else "",
        "last": rows[-1].started if rows else "",
    }


def shift_of(row):
    """Return the start of a run's shift: at 6, 14 and 22 o'clock, local time."""
    started = datetime.fromisoformat(row.started).astimezone()
    day = started.date() if started.hour >= 6 else started.date() - timedelta(days=1)
    hour = next((hour for hour in (22, 14, 6) if started.hour >= hour), 22)
    return f"{day} {hour:02}:00"


def lost_times(rows):
    """Return the time until the next start of each run, s, at most an hour."""
    starts = [datetime.fromisoformat(row.started) for row in rows]
    times = [(after - before).total_seconds() for before, after in pairwise(starts)]
    return [min(time, 3600.0) for time in [*times, *([rows[-1].cycle_time or 0.0] if rows else [])]]


def losses(rows):
    """Return the runs and the minutes of each fault, or stage and reason, of runs without success."""
    found = defaultdict(lambda: [0, 0.0])
    for row, lost in zip(rows, lost_times(rows), strict=True):
        if row.outcome != "success":
            entry = found[row.fault or f"{row.reason or row.outcome} in {row.stage}".replace("_", " ")]
            entry[0] += 1
            entry[1] += lost / 60.0
    return sorted(map(tuple, found.values()))


def shifts(rows, events):
    """Return successes, runs, minutes lost and the available share of each shift."""
    now, states = datetime.now(UTC), [event for event in events if event.kind == "state"]
    outages = [
        tuple(datetime.fromisoformat(event.time) for event in (states[place], states[place + 2]))
        for place in range(0, len(states), 3)
    ]
    found = {}
    for start in dict.fromkeys(map(shift_of, rows)):
        here = [(row, lost) for row, lost in zip(rows, lost_times(rows), strict=True) if shift_of(row) == start]
        local = datetime.fromisoformat(start)
        began = max(local.astimezone(), datetime.fromisoformat(rows[0].started))
        ended = min((local + timedelta(hours=8)).astimezone(), now)
        down = sum(max((min(last, ended) - max(first, began)).total_seconds(), 0.0) for first, last in outages)
        good = sum(row.outcome == "success" for row, _ in here)
        minutes = sum(lost for row, lost in here if row.outcome != "success") / 60.0
        found[start] = (good, len(here), minutes, 1.0 - down / (ended - began).total_seconds())
    return found


def trend(good, tried):
    """Return the mean cycle and the mean time of each stage by shift, with 2.66 mean moving ranges on both sides of their mean."""
    times = defaultdict(lambda: defaultdict(list))
    for row in good:
        if row.cycle_time is not None:
            times["cycle"][shift_of(row)].append(row.cycle_time)
        for name in {stage.name for stage in tried[row.run]}:
            spent = math.fsum(stage.ended - stage.began for stage in tried[row.run] if stage.name == name)
            times[name][shift_of(row)].append(spent)
    means = {name: {shift: mean(of) for shift, of in sorted(by.items())} for name, by in times.items()}
    limits = {}
    for name, by in means.items():
        middle = mean(by.values())
        reach = 2.66 * mean([abs(after - before) for before, after in pairwise(by.values())] or [0.0])
        limits[name] = (middle - reach, middle + reach) if len(by) >= 10 else None
    return means, limits


def agree(folder):
    """Demand that the report of every question is that of the rows."""
    with Journal(folder, is_read_only=True) as journal:
        assert journal.runs(1)
        since = (datetime.now(UTC) - timedelta(days=20)).isoformat(timespec="milliseconds")
        for query in (RunQuery(), RunQuery(since), RunQuery(serial="A-1"), RunQuery(outcome="fault"), RunQuery("9")):
            facts, wanted = facts_of(journal, query), expected(journal, query)
            assert facts.outcomes == wanted["outcomes"]
            assert {
                shift.start: (shift.runs.good, shift.runs.runs, shift.minutes, shift.availability)
                for shift in facts.shifts
            } == {start: pytest.approx(of, abs=1e-4) for start, of in wanted["shifts"].items()}
            means, limits = wanted["trend"]
            for found in facts.trends:
                assert found.means == pytest.approx(means[found.name])
                assert found.limits == (limits[found.name] and pytest.approx(limits[found.name]))
            minutes = [loss.minutes for loss in facts.losses]
            assert minutes == sorted(minutes, reverse=True)
            found = sorted((loss.count, loss.minutes) for loss in facts.losses)
            assert found == [pytest.approx(of, abs=1e-3) for of in wanted["lost"]]
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


@pytest.mark.parametrize(("seed", "zone"), [(103001, "UTC"), (103002, "Asia/Kolkata"), (103003, "America/New_York")])
def test_a_report_of_random_runs_is_that_of_their_rows(tmp_path, monkeypatch, seed, zone):
    monkeypatch.setenv("TZ", zone)
    time.tzset()
    fill(tmp_path, seed)
    agree(tmp_path)
    monkeypatch.undo()
    time.tzset()


IN_DUCKDB = """
CREATE VIEW ended AS SELECT *, least(3600, coalesce(epoch(lead(started) OVER (ORDER BY started)) - epoch(started), cycle_time, 0)) AS lost
FROM '{runs}' WHERE outcome != 'running';
SELECT
    (SELECT avg((outcome = 'success')::INT) FROM ended),
    (SELECT list(struct_pack(runs, minutes) ORDER BY minutes DESC) FROM (
        SELECT count(*) AS runs, sum(lost) / 60 AS minutes FROM ended WHERE outcome != 'success'
        GROUP BY fault, if(fault > 0, '', stage), if(fault > 0, '', if(reason = '', outcome, reason)))),
    (SELECT [quantile_cont(cycle_time, 0.5), quantile_cont(cycle_time, 0.95)] FROM ended WHERE outcome = 'success'),
    (SELECT list(peak_force ORDER BY run) FROM ended WHERE peak_force IS NOT NULL)
"""


def test_duckdb_computes_the_same_report_from_exported_runs(tmp_path, capsys):
    duckdb = pytest.importorskip("duckdb")
    fill(tmp_path, 103006)
    records = ("--journal", str(tmp_path))
    assert main(["runs", *records, "--export", "parquet", "--out", str(tmp_path / "out")]) == GOOD
    capsys.readouterr()
    assert main(["report", *records, "--json"]) == GOOD
    told = json.loads(capsys.readouterr().out)
    with duckdb.connect() as other:
        ((share, losses, cycle, forces),) = other.sql(
            IN_DUCKDB.format(runs=tmp_path / "out" / "runs.parquet")
        ).fetchall()
    assert told["yield"] == pytest.approx(share)
    assert [loss["count"] for loss in told["losses"]] == [loss["runs"] for loss in losses]
    assert [loss["minutes"] for loss in told["losses"]] == pytest.approx([loss["minutes"] for loss in losses])
    assert [told["cycle"]["median"], told["cycle"]["p95"]] == pytest.approx(cycle)
    assert sorted(told["forces"]) == pytest.approx(sorted(forces))
