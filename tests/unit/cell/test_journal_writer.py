"""What becomes of records when the program is killed, the disk is full, the index locked, torn or gone."""

import sqlite3
import subprocess
import sys
from contextlib import closing, contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial

import pytest

from cell.journal import INDEX, Journal
from cell.journal_schema import LOST, EventKind, EventRow, RunRow, StageRow
from cell.journal_upkeep import Keep
from cell.journal_writer import MOST_BLOCKS, MOST_ROWS, JournalWriter
from cell.sample_blocks import BATCH, SampleBlock, SampleStream
from cell.samples import read_samples
from tests.fakes import Rig
from tests.trouble import full_disk, until

ROW = RunRow(0, "2025-01-01T00:00:00.000+00:00", "insert_peg", 1, "A-17", "10.0.0.5:4711", 42)


@pytest.fixture
def seen(rig: Rig):
    return rig.cell.context(0).observe()


def recorded(journal, seen, scans=1, **ending):
    """Put a run on record and return its row."""
    row = journal.begin(ROW)
    stream = SampleStream(partial(journal.write, row.run))
    for _ in range(scans):
        stream.add(seen, None, 1)
    stages = [StageRow(row.run, 1, "grasp_from_rack", 0.0, 1.0, outcome="success")]
    journal.finish(replace(row, outcome="success", **ending), stages, stream.rest())
    return journal.find(row.run)


@contextmanager
def locked(folder):
    """Hold the index as another program does that writes for long."""
    with closing(sqlite3.connect(folder / INDEX, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        yield
        other.execute("ROLLBACK")


KILLED = """
import os, sys
from pathlib import Path
from cell.journal import Journal
from cell.journal_schema import RunRow
from cell.sample_blocks import JOINT_COLUMNS, SampleBlock
journal = Journal(Path(sys.argv[1]))
journal.open()
for _ in range(2):
    row = journal.begin(RunRow(0, "2025-01-01", "insert_peg", 1, "A-17", "plc", 42))
    block = SampleBlock(used=2, joints={name: [[0.0], [0.0]] for name in JOINT_COLUMNS})
    block.values[:], block.taxels[:] = 0.0, 0.0
    block.values[0, :2], block.values[13, :2], block.values[1, :2] = (1.0, 3.5), 12.0, 2.0
    journal.write(row.run, block)
journal.finish(row)
journal.find(1)
os.kill(os.getpid(), 9)
"""


def test_a_run_that_a_kill_left_open_is_closed_with_what_its_samples_tell(tmp_path):
    assert subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)], check=False).returncode == -9
    with Journal(tmp_path) as journal:
        row, done = journal.find(1), journal.find(2)
        assert (row.outcome, row.stage, row.peak_force, row.samples) == (LOST, "spray_search", 12.0, 2)
        assert row.message.startswith("its end was not recorded")
        assert row.message.endswith("samples of 2.50 s are on record")
        assert [event.name for event in journal.events(run=1)] == ["run_lost"]
        assert (done.outcome, journal.begin(ROW).run) == ("running", 4)


def test_another_program_that_writes_does_not_close_a_run_under_way(tmp_path):
    with Journal(tmp_path) as one:
        run = one.begin(ROW).run
        assert one.find(run)
        with Journal(tmp_path) as other:
            assert other.find(run).outcome == "running"


def test_two_programs_never_give_the_same_number(tmp_path):
    with Journal(tmp_path) as one, Journal(tmp_path) as other:
        runs = []
        for _ in range(3):
            runs += [one.begin(ROW).run, other.begin(ROW).run]
            assert one.runs(1) != other.runs(0)
    assert len(set(runs)) == 6


def test_numbers_go_on_without_a_gap_after_an_orderly_end(tmp_path):
    for number in (1, 2, 3):
        with Journal(tmp_path) as journal:
            assert journal.begin(ROW).run == number
    assert not (tmp_path / "run-000004.arrows").exists()


def test_a_number_is_not_given_again_after_its_run_was_deleted(tmp_path, seen):
    with Journal(tmp_path) as journal:
        recorded(journal, seen)
    with closing(sqlite3.connect(tmp_path / INDEX)) as index, index:
        index.execute("DELETE FROM runs")
    (tmp_path / "run-000001.arrows").unlink()
    with Journal(tmp_path) as journal:
        assert journal.begin(ROW).run == 2


def test_samples_are_never_written_over(tmp_path, seen):
    (tmp_path / "run-000001.arrows").write_bytes(b"precious")
    with Journal(tmp_path) as journal:
        assert recorded(journal, seen).run == 2
    assert (tmp_path / "run-000001.arrows").read_bytes() == b"precious"


@pytest.mark.parametrize("how", ["no index at all", "torn in the middle", "deleted"])
def test_a_damaged_index_is_made_again_from_the_samples(tmp_path, seen, how):
    with Journal(tmp_path) as journal:
        before = [recorded(journal, seen, peak_force=7.5), recorded(journal, seen)]
        stages = journal.stages(1)
    index = tmp_path / INDEX
    if how == "deleted":
        index.unlink()
    else:
        whole = index.read_bytes()
        index.write_bytes(b"\x00" * len(whole) if how == "no index at all" else whole[:4096] + b"\xff" * 8192)
    with Journal(tmp_path) as journal:
        assert (journal.runs(5), journal.stages(1)) == (before[::-1], stages)
        assert journal.begin(ROW).run == 3
    assert bool(list(tmp_path.glob(f"{INDEX}.damaged-*"))) == (how != "deleted")


def test_an_index_that_is_deleted_meanwhile_is_made_again(tmp_path, seen):
    with Journal(tmp_path) as journal:
        recorded(journal, seen)
        row = journal.begin(ROW)
        assert journal.find(row.run)
        for file in tmp_path.glob(f"{INDEX}*"):
            file.unlink()
        journal.note(EventRow(0, "2025", 0.0, EventKind.FAULT, "SKIN_SILENT"))
        journal.finish(replace(row, outcome="failure"))
    with Journal(tmp_path, is_read_only=True) as journal:
        assert [row.outcome for row in journal.runs(5)] == ["failure", "success"]


def test_a_locked_index_holds_up_nobody_and_nothing_is_lost(tmp_path, seen):
    with Journal(tmp_path) as journal:
        recorded(journal, seen)
        with locked(tmp_path):
            row = journal.begin(ROW)
            journal.finish(replace(row, outcome="success"))
            until(lambda: journal.trouble)
            assert "locked" in journal.trouble
        assert journal.find(row.run).outcome == "success"
        assert journal.trouble == ""


def test_a_full_disk_ends_recording_and_is_told_until_a_run_is_whole_again(tmp_path, seen):
    with Journal(tmp_path) as journal:
        recorded(journal, seen)
        with full_disk():
            row = journal.begin(ROW)
            journal.finish(replace(row, outcome="success"))
            until(lambda: journal.trouble)
        lost = journal.find(row.run)
        assert (lost.outcome, lost.samples) == ("success", 0)
        assert recorded(journal, seen).samples == 1
        assert journal.trouble == ""


def test_a_disk_with_less_than_is_asked_for_is_low_and_takes_no_samples(tmp_path, seen):
    with Journal(tmp_path, keep=Keep(least_free=10**18)) as journal:
        row = recorded(journal, seen)
        assert journal.is_disk_low
        assert (row.outcome, row.samples) == ("success", 0)
        assert "all but full" in journal.trouble


def test_samples_that_come_faster_than_the_disk_takes_them_are_told_and_counted(tmp_path, seen):
    full = SampleBlock()
    for _ in range(BATCH):
        full.add(seen, None, 1, None)
    writer = JournalWriter(tmp_path, Keep())
    row = writer.begin(ROW, None)
    for _ in range(MOST_BLOCKS + 10):
        writer.write(row.run, full)
    assert "too slowly" in writer.trouble
    writer.finish(replace(row, outcome="success"), (), None)
    writer.open()
    writer.close()
    with Journal(tmp_path, is_read_only=True) as journal:
        assert journal.find(row.run).samples == (MOST_BLOCKS - 1) * BATCH


def test_runs_older_than_is_asked_for_are_deleted_with_all_that_belongs_to_them(tmp_path, seen):
    now = datetime.now(UTC)
    with Journal(tmp_path) as journal:
        for days in (40, 1):
            recorded(journal, seen, started=(now - timedelta(days=days)).isoformat(), config_hash=f"config of {days}")
    with Journal(tmp_path, keep=Keep(days=30)) as journal:
        assert ([row.run for row in journal.runs(5)], journal.stages(1)) == ([2], [])
    assert not (tmp_path / "run-000001.arrows").exists()
    assert read_samples(tmp_path / "run-000002.arrows")["stamp"].size == 1


def test_the_oldest_samples_beyond_the_size_are_deleted_and_their_runs_stay(tmp_path, seen):
    with Journal(tmp_path) as journal:
        for _ in range(3):
            recorded(journal, seen)
    size = (tmp_path / "run-000001.arrows").stat().st_size
    with Journal(tmp_path, keep=Keep(bytes=2 * size)) as journal:
        assert len(journal.runs(5)) == 3
    assert sorted(path.name for path in tmp_path.glob("*.arrows")) == ["run-000002.arrows", "run-000003.arrows"]


@pytest.mark.parametrize("how", ["deleted", "torn"])
def test_runs_after_an_index_was_damaged_meanwhile_are_on_record(tmp_path, seen, how):
    with Journal(tmp_path) as journal:
        recorded(journal, seen)
        if how == "deleted":
            for file in tmp_path.glob(f"{INDEX}*"):
                file.unlink()
        else:
            index = tmp_path / INDEX
            index.write_bytes(b"\xff" * index.stat().st_size)
        assert recorded(journal, seen).outcome == "success"
        assert recorded(journal, seen).run == 3
    with Journal(tmp_path) as journal:
        assert [row.outcome for row in journal.runs(5)] == ["success"] * 3


def test_rows_beyond_those_that_may_wait_are_lost_and_told(tmp_path):
    writer, event = JournalWriter(tmp_path, Keep()), EventRow(0, "2025", 0.0, EventKind.FAULT, "SKIN_SILENT")
    for _ in range(MOST_ROWS):
        writer.note(event)
    assert writer.trouble == ""
    writer.note(event)
    assert writer.trouble == f"more than {MOST_ROWS} rows wait for the index; newer ones are lost"


def test_whether_all_is_written_is_told_after_as_long_as_is_asked_for(tmp_path):
    with Journal(tmp_path) as journal:
        journal.begin(ROW)
        writer = journal._writer
        assert writer.flush()
        with locked(tmp_path):
            journal.note(EventRow(0, "2025", 0.0, EventKind.FAULT, "SKIN_SILENT"))
            assert not writer.flush(timeout=0.05)
        assert writer.flush()


def test_a_writer_that_never_began_or_has_ended_has_nothing_to_wait_for(tmp_path):
    writer = JournalWriter(tmp_path, Keep())
    writer.note(EventRow(0, "2025", 0.0, EventKind.FAULT, "SKIN_SILENT"))
    assert writer.flush(timeout=0.0)
    writer.open()
    writer.close()
    writer.close()
    assert writer.flush(timeout=0.0)
