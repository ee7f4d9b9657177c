"""Questions to the records: which runs, what they say together, two side by side, and files for other tools."""

from collections import Counter
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from cell.records.index import Index
from cell.records.journal import Journal
from cell.records.run_query import RunQuery, moment
from cell.records.schema import ConfigRow, RunRow, StageRow
from cell.report.comparison import compared
from cell.report.document import write
from cell.report.facts import LEAST_DRIFT, Facts, drift_of, facts_of
from cell.report.words import tables
from drivers.errors import ConfigError
from skills.catalogue import SEARCH

NOW = datetime(2025, 6, 15, 12, tzinfo=UTC)
EVIL = "PN7[a]-[/x]<script>"
SUCCESS = {"outcome": "success", "stage": "release_and_retract", "cycle_time": 20.0, "peak_force": 15.0}


def row(number: int, days_ago: float = 0.0, **what) -> RunRow:
    started = (NOW - timedelta(days=days_ago)).isoformat(timespec="milliseconds")
    told = {"serial": f"A-{number}", **(what or SUCCESS)}
    return RunRow(number, started, "insert_peg", 0, source="10.0.0.5:4711", sequence=number, **told)


def told(runs: list[RunRow], stages: list[StageRow] = ()) -> Facts:
    """Return the facts of runs and stages that a journal has on record."""
    with TemporaryDirectory() as folder:
        index = Index(Path(folder), is_read_only=False)
        for each in runs:
            index.put(each)
            index.put_ended(each, [tried for tried in stages if tried.run == each.run])
        index.close()
        with Journal(Path(folder), is_read_only=True) as journal:
            return facts_of(journal, RunQuery())


def stage(run: int, name: str, counted: float, **what) -> StageRow:
    return StageRow(run, what.pop("place", 1), name, 0.0, counted + 4.0, counted=counted, **what)


@pytest.fixture
def journal(tmp_path):
    with Journal(tmp_path / "records") as opened:
        for asked in (
            row(1, 9.0),
            row(2, 2.0, outcome="fault", stage="spray_search", fault=2004, message="gains"),
            row(3, 1.0, outcome="failure", stage="spray_search", reason="no_hole", serial=EVIL),
            row(4, 0.1),
        ):
            begun = opened.writer.begin(replace(asked, outcome="running"))
            opened.writer.finish(replace(asked, run=begun.run), [stage(begun.run, SEARCH.name, 5.0)])
        yield opened


@pytest.mark.parametrize(
    ("query", "found"),
    [
        (RunQuery(), [4, 3, 2, 1]),
        (RunQuery(since=moment("7d", NOW)), [4, 3, 2]),
        (RunQuery(outcome="failure"), [3]),
        (RunQuery(fault=2004), [2]),
        (RunQuery(serial=EVIL), [3]),
        (RunQuery(since=moment("36h", NOW), outcome="success"), [4]),
        (RunQuery(program="recover"), []),
        (RunQuery(recipe=0), [4, 3, 2, 1]),
    ],
)
def test_a_question_finds_its_runs_and_their_stages(journal, query, found):
    assert [run.run for run in journal.select(query)] == found
    facts = facts_of(journal, query)
    assert facts.outcomes == Counter(journal.find(number).outcome for number in found)
    assert sum(stage.n for stage in facts.stages) == facts.outcomes.get("success", 0)


@pytest.mark.parametrize("text", ["7", "d7", "yesterday", "9999999w", "999999w", "2025-13-01"])
def test_an_invalid_time_is_refused_with_what_is_allowed(text):
    with pytest.raises(ConfigError, match="12h, 7d, 4w or a date"):
        moment(text, NOW)


def test_a_date_is_in_local_time_and_a_span_ends_now():
    local = datetime.fromisoformat("2025-01-31T06:00").astimezone(UTC)
    assert moment("2025-01-31T06:00", NOW) == local.isoformat(timespec="milliseconds")
    assert moment("30m", NOW) == "2025-06-15T11:30:00.000+00:00"


MINUTE = 1.0 / 1440.0
"""Length of a minute, days."""


def test_reasons_are_ordered_by_lost_time():
    lost = {"outcome": "failure", "stage": "spray_search", "reason": "no_hole"}
    fault = {"outcome": "fault", "stage": "tactile_insert", "fault": 1001}
    runs = [row(1, 30 * MINUTE, **lost), row(2, 29 * MINUTE, **lost), row(3, 28 * MINUTE, **fault), row(4, 20 * MINUTE)]
    assert [(loss.what, loss.count, round(loss.minutes, 3), loss.cumulative) for loss in told(runs).losses] == [
        ("fault 1001: no taxel frame arrived in time", 1, 8.0, pytest.approx(0.8)),
        ("no hole in spray search", 2, 2.0, pytest.approx(1.0)),
    ]


def test_only_a_worn_pad_shows_a_drift():
    rng = np.random.default_rng(1)
    days = np.linspace(0.0, 10.0, 60)
    worn, sound = (0.1 + slope * days + rng.normal(0.0, 0.01, len(days)) for slope in (0.01, 0.0))
    assert drift_of(days, worn).is_shown
    assert drift_of(days, worn).per_day == pytest.approx(0.01, abs=0.002)
    assert not drift_of(days, sound).is_shown
    assert drift_of(days[: LEAST_DRIFT - 1], worn[: LEAST_DRIFT - 1]) is None
    assert drift_of(np.ones(LEAST_DRIFT), worn[:LEAST_DRIFT]) is None


def test_a_report_is_one_file_with_foreign_text_escaped(journal, tmp_path):
    lost = row(9, outcome="failure", stage="spray_search", reason=EVIL)
    begun = journal.writer.begin(replace(lost, outcome="running"))
    journal.writer.finish(replace(lost, run=begun.run))
    facts = facts_of(journal, RunQuery())
    write(facts, tmp_path / "report.html")
    write(facts, tmp_path / "report.pdf")
    text = (tmp_path / "report.html").read_text()
    assert "<script" not in text
    assert "&lt;script&gt;" in text
    assert "http" not in text
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize("name", ["report.docx", "report"])
def test_no_runs_are_no_error_but_another_ending_is(tmp_path, name):
    assert ("yield", "no runs, 95 % interval 0.0 to 100.0 %") in tables(told([]))[0][2]
    write(told([]), tmp_path / "none.html")
    with pytest.raises(ConfigError, match=r"\*\.html, \*\.pdf allowed"):
        write(told([]), tmp_path / name)


def test_two_runs_differ_where_their_configs_do():
    first, second = row(1), row(2, outcome="failure", reason="no_hole", stage="spray_search")
    configs = [
        ConfigRow("a", '{"search": {"speed": 0.05}, "retries": 1}'),
        ConfigRow("b", '{"search": {"speed": 0.06}, "retries": 1}'),
    ]
    tried = [[stage(1, SEARCH.name, 5.0, outcome="success")], [stage(2, SEARCH.name, 9.0, reason="no_hole")]]
    found = dict(compared([first, second], tried, [config.config for config in configs]))
    assert found["config key that differs"] == [("search.speed", "0.05", "0.06")]
    assert found["stage, without and with transfer"] == [
        ("spray search", "5.00 / 9.00 s success", "9.00 / 13.00 s no_hole")
    ]
    assert ("outcome", "success", "failure") in found["record"]
    found = dict(compared([first, second], [[], []], [None, "{}"]))
    assert found["config"] == [("config on record", "not kept", "kept")]
