"""Alarms of a journal: when they came, how long they lasted, and their state."""

import json
import sqlite3
from contextlib import closing

import pytest

from cell.commands.cli import GOOD, main
from cell.records.journal import INDEX, Journal
from cell.records.schema import EventKind, EventRow

HAPPENED = (
    (0, EventKind.STATE, "IDLE", 0),
    (10, EventKind.FAULT, "SKIN_SILENT", 1001),
    (10, EventKind.STATE, "ABORTING", 0),
    (11, EventKind.STATE, "ABORTED", 0),
    (12, EventKind.WARNING, "disk low", 0),
    (20, EventKind.FAULT, "TRACKING", 2003),
    (30, EventKind.STATE, "CLEARING", 0),
    (31, EventKind.STATE, "STOPPED", 0),
    (40, EventKind.STATE, "RESETTING", 0),
    (41, EventKind.STATE, "IDLE", 0),
    (50, EventKind.WARNING, "disk low is over", 0),
    (51, EventKind.WARNING, "scan overruns", 0),
    (60, EventKind.NOTE, "run_lost", 0),
)
"""Seconds of a minute, and the kind, name and code of each event."""
FOUND = [
    ("scan overruns", 0, "active", None),
    ("TRACKING", 2003, "over", 20.0),
    ("disk low", 0, "over", 38.0),
    ("SKIN_SILENT", 1001, "over", 30.0),
]


def time_of(second):
    return f"2025-01-31T06:{second // 60:02}:{second % 60:02}.000+00:00"


def note(journal, happened):
    for second, kind, name, code in happened:
        text = "" if second % 60 == 0 else "BEFORE"
        journal.writer.note(EventRow(0, time_of(second), 1.0, kind, name, code, text=text))


@pytest.fixture
def records(tmp_path):
    with Journal(tmp_path) as journal:
        note(journal, HAPPENED)
    return tmp_path


def shown(records, capsys, *options):
    assert main(["alarms", "--journal", str(records), "--json", *options]) == GOOD
    alarms = json.loads(capsys.readouterr().out)
    return [(alarm["name"], alarm["code"], alarm["state"], alarm["duration"]) for alarm in alarms]


def test_an_alarm_lasts_until_its_reset_or_its_end(records, capsys):
    assert shown(records, capsys) == [(*alarm[:3], alarm[3] and pytest.approx(alarm[3], abs=1e-3)) for alarm in FOUND]


@pytest.mark.parametrize(
    ("options", "found"),
    [
        (["--fault", "1001"], FOUND[3:]),
        (["--since", "2025-01-31T06:00:12+00:00", "--until", "2025-01-31T06:00:20+00:00"], FOUND[2:3]),
        (["--last", "2"], FOUND[:2]),
        (["--until", "2025-01-01"], []),
    ],
)
def test_alarms_are_found_by_code_and_period(records, capsys, options, found):
    assert [name for name, *_ in shown(records, capsys, *options)] == [alarm[0] for alarm in found]


def test_a_cleared_fault_is_acknowledged_until_the_reset(tmp_path, capsys):
    with Journal(tmp_path) as journal:
        note(journal, HAPPENED[:4])
        assert [alarm.state for alarm in journal.alarms(9)] == ["active"]
        note(journal, HAPPENED[6:8])
        assert [alarm.state for alarm in journal.alarms(9)] == ["acknowledged"]


def test_no_alarm_outlives_a_restart_of_the_cell(tmp_path):
    with Journal(tmp_path) as journal:
        note(journal, [*HAPPENED[:5], (60, *HAPPENED[0][1:])])
        assert [(alarm.state, round(alarm.duration)) for alarm in journal.alarms(9)] == [("over", 48), ("over", 50)]


@pytest.mark.parametrize("words", [["alarms"], ["report"], ["runs"], ["compare", "--since", "1d", "--with", "2d"]])
def test_printed_queries_run_elsewhere(records, capsys, words):
    assert main([*words, "--sql", "--journal", str(records)]) == GOOD
    head, *script = capsys.readouterr().out.split("\n", 1)
    assert head == f"-- sqlite3 {records / INDEX}"
    with closing(sqlite3.connect(f"file:{records / INDEX}?mode=ro", uri=True)) as index:
        found = [index.execute(statement).fetchall() for statement in script[0].strip().removesuffix(";").split(";\n")]
    if words == ["alarms"]:
        assert [row[3:4] + row[2:3] for row in found[0]] == [(name, code) for name, code, *_ in FOUND]
