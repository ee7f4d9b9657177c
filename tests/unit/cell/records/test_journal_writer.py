"""Records survive a killed program, a full disk, and an index that is locked, torn or deleted."""

import os
import shutil
import sqlite3
import subprocess
import sys
import threading
from contextlib import closing, nullcontext
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


def ago(days):
    """Return the time so many days ago as text."""
    return (datetime.now(UTC) - timedelta(days=days)).isoformat()


def recorded(journal, seen, scans=1, days=None, **ending):
    """Put a run on record, which began so many days ago, and return its row."""
    row = journal.writer.begin(ROW if days is None else replace(ROW, started=ago(days)))
    stream = SampleStream(partial(journal.writer.write, row.run))
    for _ in range(scans):
        stream.add(seen, None, 1)
    stages = [StageRow(row.run, 1, "grasp_from_rack", 0.0, 1.0, outcome="success")]
    journal.writer.finish(replace(row, outcome="success", **ending), stages, stream.rest())
    return journal.find(row.run)


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


def test_a_run_of_a_killed_program_is_closed_from_its_samples(tmp_path):
    assert subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)], check=False).returncode == -9
    with Journal(tmp_path) as journal:
        row, done = journal.find(1), journal.find(2)
        assert (row.outcome, row.stage, row.peak_force, row.samples) == (LOST, "spray_search", 12.0, 2)
        assert row.message.startswith("its end was not recorded")
        assert row.message.endswith("samples of 2.50 s are on record")
        assert [event.name for event in journal.events(run=1)] == ["run_lost"]
        assert (done.outcome, journal.writer.begin(ROW).run) == ("running", 4)


def test_run_numbers_have_no_gap_and_are_never_reused(tmp_path, seen):
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
def test_a_damaged_index_is_rebuilt_from_the_samples(tmp_path, seen, how):
    with Journal(tmp_path) as journal:
        before = [recorded(journal, seen, peak_force=7.5), recorded(journal, seen)]
        stages = journal.stages(1)
    (tmp_path / "run-000003.arrows").touch()  # a killed program had reserved this number
    index = tmp_path / INDEX
    if how == "deleted":
        index.unlink()
    else:
        whole = index.read_bytes()
        index.write_bytes(b"\x00" * len(whole) if how == "no index at all" else whole[:4096] + b"\xff" * 8192)
    with Journal(tmp_path) as journal:
        assert (journal.runs(5), journal.stages(1)) == (before[::-1], stages)
        assert journal.writer.begin(ROW).run == 4
    assert bool(list(tmp_path.glob(f"{INDEX}.damaged-*"))) == (how != "deleted")


def test_a_full_disk_is_reported_until_a_run_is_recorded_whole(tmp_path, seen):
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


def test_a_nearly_full_disk_is_reported_and_gets_no_samples(tmp_path, seen):
    with Journal(tmp_path, keep=JournalConfig(least_free=10**18)) as journal:
        row = recorded(journal, seen)
        assert (journal.is_disk_low, row.outcome, row.samples) == (True, "success", 0)
        assert "all but full" in journal.trouble


def test_samples_too_fast_for_the_disk_are_dropped_and_reported(tmp_path, seen):
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


def test_old_runs_are_deleted_with_their_stages_and_samples(tmp_path, seen):
    with Journal(tmp_path) as journal:
        for days in (40, 20, 1):
            recorded(journal, seen, days=days)
    with Journal(tmp_path, keep=JournalConfig(days=30)) as journal:
        assert ([row.run for row in journal.runs(5)], journal.stages(1)) == ([3, 2], [])
    assert not (tmp_path / "run-000001.arrows").exists()
    assert read_samples(tmp_path / "run-000002.arrows")["stamp"].size == 1


def clock_ahead_by(monkeypatch, days):
    """Set the computer's clock ahead."""
    monkeypatch.setattr(wall_clock, "now", lambda: datetime.now(UTC) + timedelta(days=days))


def test_a_clock_that_is_years_ahead_deletes_no_run(tmp_path, seen, monkeypatch, caplog):
    with Journal(tmp_path) as journal:
        for days in (20, 1):
            recorded(journal, seen, days=days)
    monkeypatch.setattr(journal_writer, "UPKEEP_PERIOD", 0.0)  # each round of the writer deletes
    for start in range(3):
        clock_ahead_by(monkeypatch, 3650 + start)
        with Journal(tmp_path, keep=JournalConfig(days=30)) as journal:
            recorded(journal, seen, days=-3650 - start)
            assert sorted(row.run for row in journal.runs(9)) == list(range(1, 4 + start))
    assert read_samples(tmp_path / "run-000001.arrows")["stamp"].size == 1
    (warning,) = [record.getMessage() for record in caplog.records if "clock" in record.getMessage()]
    assert "clock 3651.0 days ahead of the newest run, at most 30 (journal.days) accepted" in warning
    monkeypatch.undo()  # the clock is set right again
    with Journal(tmp_path, keep=JournalConfig(days=30)) as journal:
        assert len(journal.runs(9)) == 5


@pytest.mark.parametrize(("days", "kept"), [(28.9, [1, 2, 3]), (29.1, [2, 3]), (29.9, [3]), (30.1, [1, 2, 3])])
def test_age_is_the_sum_of_plausible_steps_of_the_clock(tmp_path, seen, monkeypatch, days, kept):
    """Three runs began a day, six hours and no time before the clock was set `days` ahead."""
    with Journal(tmp_path) as journal:
        for day in (1.0, 0.25, 0.0):
            recorded(journal, seen, days=day)
    clock_ahead_by(monkeypatch, days)
    with closing(Index(tmp_path, is_read_only=False)) as index:
        delete_old(index, tmp_path, JournalConfig(days=30))
        assert [row.run for row in index.rows(RunRow)] == kept


def test_events_age_as_runs_do(tmp_path, monkeypatch):
    with closing(Index(tmp_path, is_read_only=False)) as index:
        for days in (40, 20, 1, -3650):
            index.put(EventRow(0, ago(days), 0.0, EventKind.WARNING, f"{days}"))
        clock_ahead_by(monkeypatch, 3651)
        delete_old(index, tmp_path, JournalConfig(days=30))
        assert [row.name for row in index.rows(EventRow)] == ["20", "1", "-3650"]


def test_the_oldest_samples_beyond_the_size_are_deleted(tmp_path, seen):
    with Journal(tmp_path) as journal:
        for _ in range(3):
            recorded(journal, seen)
    size = (tmp_path / "run-000001.arrows").stat().st_size
    with Journal(tmp_path, keep=JournalConfig(bytes=2 * size)) as journal:
        assert len(journal.runs(5)) == 3
    assert sorted(path.name for path in tmp_path.glob("*.arrows")) == ["run-000002.arrows", "run-000003.arrows"]


@pytest.mark.parametrize("how", ["deleted", "torn"])
def test_runs_during_and_after_damage_to_the_index_are_recorded(tmp_path, seen, how):
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


def test_rows_beyond_the_queue_are_lost_and_reported(tmp_path):
    writer = JournalWriter(tmp_path, JournalConfig())
    for _ in range(MOST_ROWS):
        writer.note(EVENT)
    assert writer.trouble == ""
    writer.note(EVENT)
    assert writer.trouble == f"more than {MOST_ROWS} rows wait for the index; newer ones are lost"


def test_a_flush_reports_if_all_is_written_within_its_time(tmp_path):
    with Journal(tmp_path) as journal, closing(sqlite3.connect(tmp_path / INDEX, isolation_level=None)) as other:
        journal.writer.begin(ROW)
        assert journal.writer.flush()
        other.execute("BEGIN IMMEDIATE")  # another program writes for long
        journal.writer.note(EVENT)
        assert not journal.writer.flush(timeout=0.05)
        other.execute("ROLLBACK")
        assert journal.writer.flush()


def test_a_flush_of_an_idle_writer_returns_at_once(tmp_path):
    writer = JournalWriter(tmp_path, JournalConfig())
    writer.note(EVENT)
    assert writer.flush(timeout=0.0)
    writer.open()
    for _ in range(2):
        writer.close()
    assert writer.flush(timeout=0.0)


def test_runs_are_recorded_in_a_folder_that_was_deleted(tmp_path, seen):
    with Journal(tmp_path / "runs") as journal:
        recorded(journal, seen)
        shutil.rmtree(tmp_path / "runs")
        assert [recorded(journal, seen).outcome for _ in range(2)] == ["success", "success"]


def test_a_folder_that_cannot_be_used_is_a_fault(tmp_path):
    (tmp_path / LOCK).mkdir()
    writer = JournalWriter(tmp_path, JournalConfig())
    with pytest.raises(JournalError, match=rf"^{tmp_path}: cannot be used: .*{LOCK}"):
        writer.open()
    writer.note(EVENT)
    assert writer.flush(timeout=0.0)
    writer.close()


def test_begin_and_end_are_recorded_behind_any_samples(tmp_path, seen):
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


def test_the_writers_thread_is_named_and_leaves_nothing_open(tmp_path):
    before = set(threading.enumerate())
    with Journal(tmp_path) as journal:
        journal.writer.begin(ROW)
        (thread,) = set(threading.enumerate()) - before
        assert (thread.name, thread.daemon) == ("journal", True)
    assert not thread.is_alive()
    links = [link.readlink() for link in Path("/proc/self/fd").iterdir() if link.is_symlink()]
    assert not [link for link in links if link.is_relative_to(tmp_path)]


class Turned(nullcontext):
    """A writer in the test's own thread, and its condition: while it waits, time passes and due actions happen."""

    def __init__(self, monkeypatch, folder, **keep):
        self.time, self.at = 1000.0, []
        thread = SimpleNamespace(start=lambda: self.main(), join=lambda *_: None, is_alive=lambda: True)
        monkeypatch.setattr(journal_writer, "time", SimpleNamespace(monotonic=lambda: self.time))
        monkeypatch.setattr(journal_writer, "Condition", lambda: self)
        monkeypatch.setattr(journal_writer, "Thread", lambda target, **_: setattr(self, "main", target) or thread)
        self.writer = JournalWriter(folder, JournalConfig(**keep))

    enter_result = None

    def notify_all(self):
        pass

    def wait(self, timeout):
        self.time += timeout
        for entry in [entry for entry in self.at if entry[0] <= self.time]:
            self.at.remove(entry)
            entry[1]()

    def after(self, delay, act):
        """Do something so much time after the start, s."""
        self.at.append((1000.0 + delay, act))

    def work(self, time):
        """Work for so long, s, and close; return the time of the end, s."""
        self.after(time, self.writer.close)
        self.writer.open()
        return self.time - 1000.0


@pytest.fixture
def turned(monkeypatch, tmp_path):
    return Turned(monkeypatch, tmp_path)


@pytest.fixture
def refuse(monkeypatch, turned):
    """Return what lets the index refuse the first rows after 5 s, and returns the times of all attempts, s."""

    def refuse(times, error, meanwhile=lambda: None):
        put, tried = Index.put, []

        def attempt(index, row, **how):
            tried.append(turned.time)
            if len(tried) <= times:
                meanwhile()
                raise error
            return put(index, row, **how)

        turned.after(5.0, lambda: (monkeypatch.setattr(Index, "put", attempt), turned.writer.note(EVENT)))
        return tried

    return refuse


BUSY = JournalError("index: busy")


def test_the_free_space_is_checked_every_few_seconds(tmp_path, monkeypatch):
    free = [1000]
    monkeypatch.setattr(journal_writer.shutil, "disk_usage", lambda folder: SimpleNamespace(free=free[0]))
    turned, found = Turned(monkeypatch, tmp_path, least_free=1000), []
    turned.after(500.0, lambda: (found.append(turned.writer.is_disk_low), free.__setitem__(0, 999)))
    turned.after(500.0 + 3.0 * DISK_PERIOD, lambda: found.append(turned.writer.is_disk_low))
    turned.work(600.0)
    assert found == [False, True]


def test_old_samples_are_deleted_at_the_start_and_once_an_hour(tmp_path, monkeypatch):
    turned, found = Turned(monkeypatch, tmp_path, bytes=10), []
    first, second, third = (tmp_path / f"run-00000{number}.arrows" for number in (7, 8, 9))
    first.write_bytes(b"x" * 100)
    turned.after(5.0, lambda: (found.append(first.exists()), second.write_bytes(b"x" * 100)))
    turned.after(UPKEEP_PERIOD - 20.0, lambda: found.append(second.exists()))
    turned.after(UPKEEP_PERIOD + 20.0, lambda: (found.append(second.exists()), third.write_bytes(b"x" * 100)))
    turned.after(2.0 * UPKEEP_PERIOD - 20.0, lambda: found.append(third.exists()))
    turned.after(2.0 * UPKEEP_PERIOD + 40.0, lambda: found.append(third.exists()))
    turned.work(2.0 * UPKEEP_PERIOD + 100.0)
    assert found == [False, True, False, True, False]


def test_a_refused_row_is_retried_every_second(turned, refuse, caplog):
    tried, found = refuse(3, BUSY), []
    turned.after(12.0, lambda: found.append(turned.writer.trouble))
    turned.work(30.0)
    assert np.diff(tried) == pytest.approx([RETRY_AFTER] * 3)
    assert found == ["index: busy"]
    assert caplog.messages == ["not on record, tried again: index: busy"]
    assert turned.writer.trouble == ""


def test_a_lack_of_files_is_reported_until_it_is_over(tmp_path, turned, monkeypatch):
    opened, found = os.open, []

    def refused(path, flags, *mode):
        if flags & os.O_EXCL:
            raise OSError(28, "No space left on device")
        return opened(path, flags, *mode)

    turned.after(5.0, lambda: (monkeypatch.setattr(os, "open", refused), turned.writer.begin(ROW)))
    for time in (40.0, 41.0):  # before and after an event is written
        turned.after(time, lambda: (found.append(turned.writer.trouble), turned.writer.note(EVENT)))
    turned.after(50.0, lambda: monkeypatch.setattr(os, "open", opened))
    turned.work(70.0)
    assert found == [f"{tmp_path}: no file can be made: No space left on device"] * 2
    assert turned.writer.trouble == ""


def test_a_closing_writer_retries_faster_until_its_time_is_over(turned, refuse):
    tried = refuse(10**6, BUSY)
    assert turned.work(20.0) == pytest.approx(20.0 + CLOSING_TIME, abs=RETRY_AFTER + 0.2)
    assert np.diff(tried)[-20:] == pytest.approx([RETRY_AFTER / 10.0] * 20, abs=0.051)


def test_a_torn_index_is_set_aside_and_waiting_rows_are_recorded(tmp_path, turned, refuse):
    refuse(1, DamagedIndexError("torn in the middle"))
    turned.writer.write(turned.writer.begin(ROW).run, SampleBlock())  # its run goes on, and is not lost
    turned.work(20.0)
    with Journal(tmp_path, is_read_only=True) as journal:
        texts = {event.name: event.text for event in journal.events()}
    assert texts["index_damaged"].startswith(f"torn in the middle; kept as {INDEX}.damaged-")
    assert texts.keys() == {"index_damaged", "SKIN_SILENT"}


def test_a_torn_index_that_cannot_be_set_aside_is_reported(tmp_path, turned, refuse):
    found = []
    refuse(1, DamagedIndexError("torn"), (tmp_path / INDEX).unlink)
    turned.after(10.5, lambda: found.append(turned.writer.trouble))
    turned.work(20.0)
    assert f"{tmp_path / INDEX}: damaged, and cannot be put aside: " in found[0]
    assert turned.writer.trouble == ""


def test_an_error_inside_the_writer_is_reported(tmp_path, turned):
    turned.after(5.0, lambda: turned.writer.write(99, SampleBlock()))  # a run that never began
    assert turned.work(50.0) < 50.0
    assert turned.writer.trouble == "the journal's writer ended: KeyError: 99"
    assert not list(tmp_path.glob("*.arrows"))
