"""Queries to a journal that is filled with copies of a few recorded runs."""

from cell.records.journal import Journal
from cell.records.run_query import RunQuery
from tests.bench import records as measure

RUNS = 40


def test_a_filled_journal_answers_as_one_that_the_cell_has_written(tmp_path):
    measure.fill(tmp_path, RUNS, lambda count: None, measure.MADE[1:])
    with Journal(tmp_path, is_read_only=True) as journal:
        rows = journal.select(RunQuery())
        assert [row.run for row in rows] == list(range(RUNS, 0, -1))
        assert {row.outcome for row in rows[-2:]} == {"failure", "fault"}
        assert journal.select(RunQuery(fault=measure.FAULT))
        assert len(journal.select(RunQuery(serial=f"SN{RUNS:07d}"))) == 1
        assert journal.stages(RUNS)
        assert journal.events(run=RUNS)
    asked = measure.questions(RUNS, tmp_path / "report")
    words = {name: asked[name] for name in asked if not name.startswith("report --out")}  # drawing has its own tests
    lines = measure.measure(tmp_path, RUNS, 1, lambda: None, words)
    assert [line.question for line in lines] == [*words, "page: summary", "page: a run"]
    assert all(line.time > 0.0 for line in lines)
