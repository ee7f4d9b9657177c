"""What becomes of records when the program is killed, the disk is full, the index locked, torn or gone."""

import sqlite3
import subprocess
import sys
import threading
from contextlib import closing, contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cell.config.cell_config import JournalConfig
from cell.records import wall_clock
from cell.records import writer as journal_writer
from cell.records.index import DamagedIndexError, Index
from cell.records.journal import INDEX, Journal
from cell.records.sample_blocks import BATCH, SampleBlock, SampleStream
from cell.records.samples import read_samples
from cell.records.schema import LOST, EventKind, EventRow, RunRow, StageRow
from cell.records.upkeep import delete_old
from cell.records.writer import (
    CLOSING_TIME,
    DISK_PERIOD,
    LOCK,
    MOST_BLOCKS,
    MOST_ROWS,
    RETRY_AFTER,
    UPKEEP_PERIOD,
    JournalWriter,
)
from drivers.errors import JournalError
from tests.trouble import full_disk, until

EVENT = EventRow(0, "2025", 0.0, EventKind.FAULT, "SKIN_SILENT")
ROW = RunRow(0, "2025-01-01T00:00:00.000+00:00", "insert_peg", 1, "A-17", "10.0.0.5:4711", 42)


def recorded(journal, seen, scans=1, began=ROW.started, **ending):
    """Put a run on record and return its row."""
    row = journal.writer.begin(replace(ROW, started=began))
    stream = SampleStream(partial(journal.writer.write, row.run))
    for _ in range(scans):
        stream.add(seen, None, 1)
    stages = [StageRow(row.run, 1, "grasp_from_rack", 0.0, 1.0, outcome="success")]
    journal.writer.finish(replace(row, outcome="success", **ending), stages, stream.rest())
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
import numpy as np
from pathlib import Path
from cell.records.journal import Journal
from cell.records.schema import RunRow
from cell.records.sample_blocks import JOINT_COLUMNS, SampleBlock
journal = Journal(Path(sys.argv[1]))
journal.open()
for _ in range(2):
    row = journal.writer.begin(RunRow(0, "2025-01-01", "insert_peg", 1, "A-17", "plc", 42))
    block = SampleBlock(used=2, joints={name: [[0.0], [0.0]] for name in JOINT_COLUMNS})
    block.values[:], block.taxels = 0.0, [np.zeros(40)] * 2
    block.values[0, :2], block.values[13, :2], block.values[1, :2] = (1.0, 3.5), 12.0, 2.0
    journal.writer.write(row.run, block)
journal.writer.finish(row)
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
        assert (done.outcome, journal.writer.begin(ROW).run) == ("running", 4)


def test_numbers_go_on_without_a_gap_and_are_never_given_again(tmp_path, seen):
    for number in (1, 2, 3):
        with Journal(tmp_path) as journal:
            assert recorded(journal, seen).run == number
    assert not (tmp_path / "run-000004.arrows").exists()
    with closing(sqlite3.connect(tmp_path / INDEX)) as index, index:
        index.execute("DELETE FROM runs")
    (tmp_path / "run-000003.arrows").unlink()
    with Journal(tmp_path) as journal:
        assert journal.writer.begin(ROW).run == 4


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
        assert journal.writer.begin(ROW).run == 3
    assert bool(list(tmp_path.glob(f"{INDEX}.damaged-*"))) == (how != "deleted")


def test_a_full_disk_ends_recording_and_is_told_until_a_run_is_whole_again(tmp_path, seen):
    with Journal(tmp_path) as journal:
        recorded(journal, seen)
        with full_disk():
            row = journal.writer.begin(ROW)
            journal.writer.finish(replace(row, outcome="success"))
            until(lambda: journal.trouble)
        lost = journal.find(row.run)
        assert (lost.outcome, lost.samples) == ("success", 0)
        assert recorded(journal, seen).samples == 1
        assert journal.trouble == ""


def test_a_disk_with_less_than_is_asked_for_is_low_and_takes_no_samples(tmp_path, seen):
    with Journal(tmp_path, keep=JournalConfig(least_free=10**18)) as journal:
        row = recorded(journal, seen)
        assert journal.is_disk_low
        assert (row.outcome, row.samples) == ("success", 0)
        assert "all but full" in journal.trouble


def test_samples_that_come_faster_than_the_disk_takes_them_are_told_and_counted(tmp_path, seen):
    full = SampleBlock()
    for _ in range(BATCH):
        full.add(seen, None, 1, None)
    writer = JournalWriter(tmp_path, JournalConfig())
    row = writer.begin(ROW, None)
    for _ in range(MOST_BLOCKS + 10):
        writer.write(row.run, full)
    assert writer.trouble == f"run {row.run}: the disk takes samples too slowly; some are lost"
    writer.finish(replace(row, outcome="success"), (), None)
    writer.open()
    writer.close()
    with Journal(tmp_path, is_read_only=True) as journal:
        assert journal.find(row.run).samples == (MOST_BLOCKS - 1) * BATCH


def test_runs_older_than_is_asked_for_are_deleted_with_all_that_belongs_to_them(tmp_path, seen):
    now = datetime.now(UTC)
    with Journal(tmp_path) as journal:
        for days in (40, 20, 1):
            recorded(journal, seen, started=(now - timedelta(days=days)).isoformat(), config_hash=f"config of {days}")
    with Journal(tmp_path, keep=JournalConfig(days=30)) as journal:
        assert ([row.run for row in journal.runs(5)], journal.stages(1)) == ([3, 2], [])
    assert not (tmp_path / "run-000001.arrows").exists()
    assert read_samples(tmp_path / "run-000002.arrows")["stamp"].size == 1


def clock_ahead_by(monkeypatch, days):
    """Set the computer's clock ahead, as all of the cell reads it."""
    monkeypatch.setattr(wall_clock, "now", lambda: datetime.now(UTC) + timedelta(days=days))


def test_a_clock_that_is_years_ahead_for_many_starts_deletes_no_run_of_the_last_days(
    tmp_path, seen, monkeypatch, caplog
):
    now = datetime.now(UTC)
    with Journal(tmp_path) as journal:
        for days in (20, 1):
            recorded(journal, seen, began=(now - timedelta(days=days)).isoformat())
    monkeypatch.setattr(journal_writer, "UPKEEP_PERIOD", 0.0)  # each round of the writer deletes
    for start in range(3):
        clock_ahead_by(monkeypatch, 3650 + start)
        with Journal(tmp_path, keep=JournalConfig(days=30)) as journal:
            recorded(journal, seen, began=wall_clock.now().isoformat())
            assert sorted(row.run for row in journal.runs(9)) == list(range(1, 4 + start))
    assert read_samples(tmp_path / "run-000001.arrows")["stamp"].size == 1
    (warning,) = [record.getMessage() for record in caplog.records if "clock" in record.getMessage()]
    assert "clock 3651.0 days ahead of the newest run, at most 30 (journal.days) accepted" in warning
    monkeypatch.undo()  # the clock is set right again
    with Journal(tmp_path, keep=JournalConfig(days=30)) as journal:
        assert len(journal.runs(9)) == 5


@pytest.mark.parametrize(("days", "kept"), [(28.9, [1, 2, 3]), (29.1, [2, 3]), (29.9, [3]), (30.1, [1, 2, 3])])
def test_age_counts_over_steps_that_can_be_believed(tmp_path, seen, monkeypatch, days, kept):
    """The oldest run began 18 hours before the next, that one six before the newest, which began `days` ago by the clock."""
    with Journal(tmp_path) as journal:
        for day in (1.0, 0.25, 0.0):
            recorded(journal, seen, began=(datetime.now(UTC) - timedelta(days=day)).isoformat())
    clock_ahead_by(monkeypatch, days)
    with closing(Index(tmp_path, is_read_only=False)) as index:
        delete_old(index, tmp_path, JournalConfig(days=30))
        assert [row.run for row in index.rows(RunRow)] == kept


def test_events_age_as_runs_do(tmp_path, monkeypatch):
    now = datetime.now(UTC)
    with closing(Index(tmp_path, is_read_only=False)) as index:
        for days in (40, 20, 1, -3650):
            time = (now - timedelta(days=days)).isoformat()
            index.put(EventRow(0, time, 0.0, EventKind.WARNING, f"{days}"))
        clock_ahead_by(monkeypatch, 3651)
        delete_old(index, tmp_path, JournalConfig(days=30))
        assert [row.name for row in index.rows(EventRow)] == ["20", "1", "-3650"]


def test_the_oldest_samples_beyond_the_size_are_deleted_and_their_runs_stay(tmp_path, seen):
    with Journal(tmp_path) as journal:
        for _ in range(3):
            recorded(journal, seen)
    size = (tmp_path / "run-000001.arrows").stat().st_size
    with Journal(tmp_path, keep=JournalConfig(bytes=2 * size)) as journal:
        assert len(journal.runs(5)) == 3
    assert sorted(path.name for path in tmp_path.glob("*.arrows")) == ["run-000002.arrows", "run-000003.arrows"]


@pytest.mark.parametrize("how", ["deleted", "torn"])
def test_runs_under_way_and_after_an_index_was_damaged_are_on_record(tmp_path, seen, how):
    with Journal(tmp_path) as journal:
        recorded(journal, seen)
        row = journal.writer.begin(ROW)
        assert journal.find(row.run)
        if how == "deleted":
            for file in tmp_path.glob(f"{INDEX}*"):
                file.unlink()
        else:
            index = tmp_path / INDEX
            index.write_bytes(b"\xff" * index.stat().st_size)
        journal.writer.note(EVENT)
        journal.writer.finish(replace(row, outcome="failure"))
        assert recorded(journal, seen).run == 3
    with Journal(tmp_path) as journal:
        assert [row.outcome for row in journal.runs(5)] == ["success", "failure", "success"]
        assert "SKIN_SILENT" in [event.name for event in journal.events()]


def test_a_run_under_the_number_that_was_kept_ready_while_the_index_was_made_again_is_on_record(tmp_path, seen):
    with Journal(tmp_path) as journal:
        recorded(journal, seen)
        journal._writer.flush()
        assert (tmp_path / "run-000002.arrows").stat().st_size == 0
        damage = iter([DamagedIndexError("torn")])

        def finds_damage(index):
            for error in damage:
                raise error

        journal.writer._add_row(finds_damage)
        journal._writer.flush()
        recorded(journal, seen)
        assert [(row.run, row.outcome) for row in journal.runs(5)] == [(2, "success"), (1, "success")]


def test_rows_beyond_those_that_may_wait_are_lost_and_told(tmp_path):
    writer = JournalWriter(tmp_path, JournalConfig())
    for _ in range(MOST_ROWS):
        writer.note(EVENT)
    assert writer.trouble == ""
    writer.note(EVENT)
    assert writer.trouble == f"more than {MOST_ROWS} rows wait for the index; newer ones are lost"


def test_whether_all_is_written_is_told_after_as_long_as_is_asked_for(tmp_path):
    with Journal(tmp_path) as journal:
        journal.writer.begin(ROW)
        writer = journal._writer
        assert writer.flush()
        with locked(tmp_path):
            journal.writer.note(EVENT)
            assert not writer.flush(timeout=0.05)
        assert writer.flush()


def test_a_writer_that_never_began_or_has_ended_has_nothing_to_wait_for(tmp_path):
    writer = JournalWriter(tmp_path, JournalConfig())
    writer.note(EVENT)
    assert writer.flush(timeout=0.0)
    writer.open()
    for _ in range(2):
        writer.close()
    assert writer.flush(timeout=0.0)


# The thread itself, with a wall clock that goes on while it waits.


class Turned:
    """A writer that works in the test's own thread, and the condition that it waits at: what is due happens meanwhile."""

    def __init__(self, monkeypatch, folder, **keep):
        self.time, self.at = 1000.0, []
        monkeypatch.setattr(journal_writer, "time", SimpleNamespace(monotonic=lambda: self.time))
        self.writer = JournalWriter(folder, JournalConfig(**keep))
        self.writer._changed = self

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def notify_all(self):
        pass

    def wait(self, timeout):
        self.time += timeout
        for entry in [entry for entry in self.at if entry[0] <= self.time]:
            self.at.remove(entry)
            entry[1]()

    def after(self, delay, act):
        """Do something when so much time has passed since the beginning, s."""
        self.at.append((1000.0 + delay, act))

    def work(self, time):
        """Let it work for so long, s, and close."""
        self.after(time, lambda: setattr(self.writer, "_is_closing", True))
        self.writer._work()
        return self.time - 1000.0


@pytest.fixture
def turned(monkeypatch, tmp_path):
    return Turned(monkeypatch, tmp_path)


class Refused:
    """A row that the index does not take so many times; the times at which it was tried."""

    def __init__(self, turned, times, error=None):
        self.turned, self.left, self.tried = turned, times, []
        self.error = error or JournalError("index: busy")

    def __call__(self, index):
        self.tried.append(self.turned.time - 1000.0)
        self.left -= 1
        if self.left >= 0:
            raise self.error


def test_the_free_space_is_looked_at_at_the_start_and_every_few_seconds(tmp_path, monkeypatch):
    free = [1000]
    monkeypatch.setattr(journal_writer.shutil, "disk_usage", lambda folder: SimpleNamespace(free=free[0]))
    turned, told = Turned(monkeypatch, tmp_path, least_free=1000), []
    turned.after(500.0, lambda: (told.append(turned.writer.is_disk_low), free.__setitem__(0, 999)))
    turned.after(500.0 + 3.0 * DISK_PERIOD, lambda: told.append(turned.writer.is_disk_low))
    turned.work(600.0)
    assert told == [False, True]


def test_what_is_beyond_the_limits_is_deleted_at_the_start_and_once_an_hour(tmp_path, monkeypatch):
    turned, there = Turned(monkeypatch, tmp_path, bytes=10), []
    first, second, third = (tmp_path / f"run-00000{number}.arrows" for number in (7, 8, 9))
    first.write_bytes(b"x" * 100)
    turned.after(5.0, lambda: (there.append(first.exists()), second.write_bytes(b"x" * 100)))
    turned.after(UPKEEP_PERIOD - 20.0, lambda: there.append(second.exists()))
    turned.after(UPKEEP_PERIOD + 20.0, lambda: (there.append(second.exists()), third.write_bytes(b"x" * 100)))
    turned.after(2.0 * UPKEEP_PERIOD - 20.0, lambda: there.append(third.exists()))
    turned.after(2.0 * UPKEEP_PERIOD + 40.0, lambda: there.append(third.exists()))
    turned.work(2.0 * UPKEEP_PERIOD + 100.0)
    assert there == [False, True, False, True, False]


def test_a_row_that_the_index_does_not_take_is_tried_again_every_second_until_it_does(turned, caplog):
    row, told = Refused(turned, 3), []
    turned.after(5.0, lambda: turned.writer._add_row(row))
    turned.after(12.0, lambda: told.append(turned.writer.trouble))
    turned.work(30.0)
    assert np.diff(row.tried) == pytest.approx([RETRY_AFTER] * 3)
    assert told == ["index: busy"]
    assert caplog.messages == ["not on record, tried again: index: busy"]
    assert turned.writer.trouble == ""


def test_a_writer_that_shall_end_tries_more_often_and_gives_up_after_the_time_for_it(turned):
    row = Refused(turned, 10**6)
    turned.after(5.0, lambda: turned.writer._add_row(row))
    assert turned.work(20.0) == pytest.approx(20.0 + CLOSING_TIME, abs=RETRY_AFTER + 0.2)
    assert np.diff(row.tried)[-20:] == pytest.approx([RETRY_AFTER / 10.0] * 20, abs=0.051)


def test_a_torn_index_is_put_aside_with_why_and_nothing_that_waits_is_lost(tmp_path, turned):
    row = Refused(turned, 1, DamagedIndexError("torn in the middle"))
    turned.writer._add_row(row)
    turned.writer.note(EVENT)
    turned.work(5.0)
    with Journal(tmp_path, is_read_only=True) as journal:
        told = {event.name: event.text for event in journal.events()}
    assert told["index_damaged"].startswith(f"torn in the middle; kept as {INDEX}.damaged-")
    assert ("SKIN_SILENT" in told, len(row.tried)) == (True, 2)


def test_a_torn_index_that_cannot_be_put_aside_is_told(tmp_path, turned):
    told = []

    def torn(index):
        if not told:
            (tmp_path / INDEX).unlink()
            raise DamagedIndexError("torn")

    turned.writer._add_row(torn)
    turned.after(0.5, lambda: told.append(turned.writer.trouble))
    turned.work(5.0)
    assert f"{tmp_path / INDEX}: damaged, and cannot be put aside: " in told[0]
    assert turned.writer.trouble == ""


def test_an_error_inside_the_writer_is_told_and_its_files_are_closed(tmp_path, turned):
    turned.after(5.0, lambda: turned.writer._add_block(lambda: 1 // 0))
    assert turned.work(50.0) < 50.0
    assert turned.writer.trouble == "the journal's writer ended: ZeroDivisionError: integer division or modulo by zero"
    assert not list(tmp_path.glob("*.arrows"))


def test_a_folder_that_cannot_be_used_is_told_and_leaves_nothing_to_wait_for(tmp_path):
    writer = JournalWriter(tmp_path / "gone", JournalConfig())
    writer._claim()
    assert writer.trouble == f"{tmp_path / 'gone'}: no file can be made: No such file or directory"
    (tmp_path / LOCK).mkdir()
    writer = JournalWriter(tmp_path, JournalConfig())
    with pytest.raises(JournalError, match=rf"^{tmp_path}: cannot be used: .*{LOCK}"):
        writer.open()
    writer.note(EVENT)
    assert writer.flush(timeout=0.0)
    writer.close()


def test_the_beginning_and_the_end_of_a_run_are_written_however_many_samples_wait(tmp_path, seen):
    block = SampleBlock()
    block.add(seen, None, 1, None)
    writer = JournalWriter(tmp_path, JournalConfig())
    first = writer.begin(ROW, None)
    for _ in range(MOST_BLOCKS):
        writer.write(first.run, block)
    second = writer.begin(ROW, None)
    writer.finish(replace(second, outcome="success"), (), block)
    writer.open()
    writer.close()
    assert writer.trouble == ""
    with Journal(tmp_path, is_read_only=True) as journal:
        assert (journal.find(second.run).outcome, journal.find(second.run).samples) == ("success", 1)


def test_the_thread_of_the_writer_has_a_name_and_leaves_nothing_open(tmp_path):
    before = set(threading.enumerate())
    with Journal(tmp_path) as journal:
        journal.writer.begin(ROW)
        (thread,) = set(threading.enumerate()) - before
        assert (thread.name, thread.daemon) == ("journal", True)
    assert not thread.is_alive()
    links = [link.readlink() for link in Path("/proc/self/fd").iterdir() if link.is_symlink()]
    assert not [link for link in links if link.is_relative_to(tmp_path)]
